"use strict";
/* Curves: a chart per album, one choice of cam angles for all. */
(() => {
  document.documentElement.classList.add("scripted");
  const data = JSON.parse(document.getElementById("data").textContent);
  const colours = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];
  const dashes = ["solid", "dash", "dashdot", "longdash"];
  const number = (id) => document.getElementById(id);
  const rigid = number("rigid");
  let shown = null; /* cam angles, deg; null for all */
  let reset = 0; /* so often everything was shown again: what a mouse had zoomed is then forgotten */

  const array = (packed) => {
    const bytes = Uint8Array.from(atob(packed.bdata), (c) => c.charCodeAt(0));
    return packed.dtype === "f8" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
  };
  const cache = new Map();
  const unpacked = (packed) => {
    if (!cache.has(packed)) cache.set(packed, array(packed));
    return cache.get(packed);
  };
  const span = data.albums.flatMap((album) => album.charts).flatMap((chart) => chart.panels)
    .flatMap((panel) => panel.curves).reduce((ends, curve) => {
      const x = unpacked(curve.x);
      return [Math.min(ends[0], x[0]), Math.max(ends[1], x[x.length - 1])];
    }, [Infinity, -Infinity]).map((end) => Math.round(end * 1e3) / 1e3);

  const axis = (i) => (i === 0 ? "" : String(i + 1));
  const lone = (chart) => new Set(chart.panels.flatMap((panel) => panel.curves.map((curve) => curve.group))).size === 1;
  const colour = (chart, curve) => colours[curve.rigid && lone(chart) ? 1 : curve.group % colours.length];
  const traces = (chart) => chart.panels.flatMap((panel, i) => panel.curves
    .filter((curve) => rigid.checked || !curve.rigid)
    .map((curve) => ({
      x: unpacked(curve.x), y: unpacked(curve.y), type: "scatter", mode: "lines", name: curve.name,
      xaxis: "x", yaxis: "y" + axis(i), legendgroup: curve.name, showlegend: i === 0 && Boolean(curve.name),
      line: { color: colour(chart, curve), width: curve.rigid ? 1.6 : 2,
        dash: curve.rigid ? "dot" : dashes[curve.group % dashes.length] },
      hovertemplate: "%{y:.5~g}<extra>%{fullData.name}</extra>",
    })));
  const tick = () => {
    const wide = (shown || span)[1] - (shown || span)[0];
    return [5, 10, 15, 30, 45, 90, 180, 360].find((step) => wide / step <= 9) || undefined;
  };
  const layout = (chart) => {
    const made = {
      height: 110 + 170 * Math.max(chart.panels.length, 2), margin: { l: 64, r: 12, t: 34, b: 48 },
      hovermode: "x unified", dragmode: "zoom", font: { family: "inherit", size: 13, color: "#1a1a1a" },
      legend: { orientation: "h", y: 1.0, yanchor: "bottom", x: 0 }, uirevision: `${chart.name} ${reset}`,
      grid: { rows: chart.panels.length, columns: 1, subplots: chart.panels.map((_, i) => ["xy" + axis(i)]), ygap: 0.12 },
      xaxis: { title: { text: "cam angle, deg" }, range: [...(shown || span)], dtick: tick(), gridcolor: "#e2e2e2",
        showline: true, linecolor: "#777", uirevision: String(shown), anchor: "y" + axis(chart.panels.length - 1), zeroline: false },
    };
    chart.panels.forEach((panel, i) => {
      made["yaxis" + axis(i)] = { title: { text: panel.label.replace(", ", "<br>"), standoff: 8 }, gridcolor: "#e2e2e2",
        zerolinecolor: "#999", automargin: true, exponentformat: "power", minexponent: 4, showline: true, linecolor: "#777" };
    });
    return made;
  };
  // Nothing of a result leaves this page: no button that uploads a chart.
  const options = { displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };

  const picked = (i) => data.albums[i].charts[Number(number("pick-" + i).value)];
  const draw = (i) => {
    const chart = picked(i);
    const words = number("words-" + i);
    words.replaceChildren(...chart.words.map((sentence) => {
      const item = document.createElement("li");
      item.textContent = sentence;
      return item;
    }));
    return Plotly.react("chart-" + i, traces(chart), layout(chart), options);
  };
  const drawAll = () => data.albums.forEach((_, i) => draw(i));
  const show = (range) => {
    shown = range;
    reset += range ? 0 : 1;
    const [from, to] = range || span;
    number("from").value = Number(from.toPrecision(6));
    number("to").value = Number(to.toPrecision(6));
    drawAll();
  };

  number("window")?.addEventListener("submit", (event) => {
    event.preventDefault();
    const ends = [Number(number("from").value), Number(number("to").value)];
    if (ends[1] > ends[0]) show(ends);
  });
  number("whole")?.addEventListener("click", () => show(null));
  number("last")?.addEventListener("click", () => show([Math.max(span[1] - 360, span[0]), span[1]]));
  rigid?.addEventListener("change", drawAll);
  data.albums.forEach((_, i) => {
    number("pick-" + i).addEventListener("change", () => draw(i));
    draw(i);
    number("chart-" + i).on("plotly_relayout", (change) => {
      if ("xaxis.range[0]" in change) show([change["xaxis.range[0]"], change["xaxis.range[1]"]]);
      if (change["xaxis.autorange"]) show(null);
    });
  });
  if (data.albums.length) show(null);
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((one) => { one.open = true; }));
})();
