"use strict";
/* Members as lines in space on a canvas: modes swing, the run goes on; turned by mouse, finger or arrow keys. */
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const colours = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];
  const dashes = [[], [9, 5], [9, 4, 2, 4], [3, 3]];
  const views = { oblique: [-0.65, 0.42], xy: [0, 0], xz: [0, Math.PI / 2], yz: [-Math.PI / 2, 0] };
  const swing = 1600; /* ms of a swing of a mode */
  const revolution = 6000; /* ms of the run's last revolution */

  const array = (packed) => {
    const bytes = Uint8Array.from(atob(packed.bdata), (c) => c.charCodeAt(0)).buffer;
    return packed.dtype === "f8" ? new Float64Array(bytes) : new Float32Array(bytes);
  };
  const largest = (values) => {
    let most = 0;
    for (let i = 0; i < values.length; i += 3) most = Math.max(most, Math.hypot(values[i], values[i + 1], values[i + 2]));
    return most;
  };

  const made = (figure) => {
    const scene = data.scenes[Number(figure.dataset.scene)];
    const find = (selector) => figure.querySelector(selector);
    const canvas = find("canvas"), play = find(".play"), pick = find(".shape"), size = find(".size"), view = find(".view"), named = find(".names");
    const lines = Object.entries(scene.lines), names = Object.entries(scene.names);
    const points = array(scene.points), count = points.length / 3;
    const low = [0, 1, 2].map((k) => Math.min(...points.filter((_, i) => i % 3 === k)));
    const high = [0, 1, 2].map((k) => Math.max(...points.filter((_, i) => i % 3 === k)));
    const middle = low.map((one, k) => (one + high[k]) / 2);
    const extent = Math.max(Math.hypot(...low.map((one, k) => high[k] - one)), 1e-9);
    let angles = [...views.oblique], zoom = 1, phase = 0.25, running = 0, before = 0, shape = null;

    const choose = () => {
      const one = scene.shapes[Number(pick.value)];
      const frames = array(one.frames);
      shape = { one, frames, count: frames.length / points.length, most: largest(frames) };
      phase = shape.count === 1 ? 0.25 : 0;
      draw();
      tell();
    };
    const factor = () => (shape.most > 0 ? 0.12 * extent / shape.most * 10 ** Number(size.value) : 0);
    const tell = () => {
      const scale = shape.count === 1 ? "The size of a mode is free" : `Drawn ${factor().toPrecision(2)} times the computed motion`;
      const still = shape.most > 0 ? "" : " No member moves.";
      find(".words").textContent = `${shape.one.name}: ${shape.one.words}.${still} ${scale}.`;
    };
    const displaced = (i, k) => {
      if (shape.count === 1) return Math.sin(2 * Math.PI * phase) * shape.frames[3 * i + k];
      const at = phase * (shape.count - 1), first = Math.min(Math.floor(at), shape.count - 2), part = at - first;
      const frame = (n) => shape.frames[3 * (n * count + i) + k];
      return (1 - part) * frame(first) + part * frame(first + 1);
    };
    const project = (at, scale) => {
      const [turn, tilt] = angles;
      const x = Math.cos(turn) * at[0] + Math.sin(turn) * at[2], z = -Math.sin(turn) * at[0] + Math.cos(turn) * at[2];
      return [canvas.width / 2 + scale * x, canvas.height / 2 - scale * (Math.cos(tilt) * at[1] - Math.sin(tilt) * z)];
    };
    const place = (i, moved) => [0, 1, 2].map((k) => points[3 * i + k] - middle[k] + moved * displaced(i, k));

    const draw = () => {
      const ratio = window.devicePixelRatio || 1, pen = canvas.getContext("2d");
      canvas.width = Math.max(canvas.clientWidth * ratio, 1);
      canvas.height = Math.max(canvas.clientHeight * ratio, 1);
      const scale = zoom * 0.8 * Math.min(canvas.width, canvas.height) / extent, amount = factor();
      const path = (line, moved) => {
        pen.beginPath();
        for (let i = line[0]; i < line[1]; i += 1) pen.lineTo(...project(place(i, moved), scale));
        pen.stroke();
      };
      pen.clearRect(0, 0, canvas.width, canvas.height);
      pen.font = `${13 * ratio}px sans-serif`;
      pen.lineJoin = "round";
      lines.forEach(([, line]) => {
        pen.setLineDash([]);
        pen.strokeStyle = "#b5b5b5";
        pen.lineWidth = 1.5 * ratio;
        path(line, 0);
      });
      lines.forEach(([, line], n) => {
        pen.setLineDash(dashes[n % dashes.length].map((one) => one * ratio));
        pen.strokeStyle = colours[n % colours.length];
        pen.lineWidth = 3.5 * ratio;
        path(line, amount);
      });
      pen.setLineDash([]);
      lines.forEach(([name], n) => {
        pen.fillStyle = colours[n % colours.length];
        pen.fillText(name, 12 * ratio, (20 + 18 * n) * ratio);
      });
      pen.fillStyle = "#1a1a1a";
      names.forEach(([name, at]) => {
        const [x, y] = project(place(at, amount), scale);
        pen.beginPath();
        pen.arc(x, y, 3 * ratio, 0, 2 * Math.PI);
        pen.fill();
        if (named.checked) pen.fillText(name, x + 6 * ratio, y - 6 * ratio);
      });
      triad(pen, ratio);
      figure.dataset.phase = phase.toFixed(4);
    };
    const triad = (pen, ratio) => {
      const at = [40 * ratio, canvas.height - 40 * ratio], centre = [canvas.width / 2, canvas.height / 2];
      pen.strokeStyle = pen.fillStyle = "#565656";
      pen.lineWidth = 1.2 * ratio;
      ["x", "y", "z"].forEach((name, k) => {
        const end = project([0, 1, 2].map((one) => (one === k ? 1 : 0)), 26 * ratio).map((one, j) => one - centre[j] + at[j]);
        pen.beginPath();
        pen.moveTo(...at);
        pen.lineTo(...end);
        pen.stroke();
        if (Math.hypot(end[0] - at[0], end[1] - at[1]) > 4) pen.fillText(name, end[0] + 3 * ratio, end[1]);
      });
    };

    const step = (now) => {
      if (!running) return;
      phase = (phase + Math.max(now - before, 0) / (shape.count === 1 ? swing : revolution)) % 1;
      before = now;
      draw();
      running = requestAnimationFrame(step);
    };
    const toggle = () => {
      const on = !running;
      if (!on) cancelAnimationFrame(running);
      before = performance.now();
      running = on ? requestAnimationFrame(step) : 0;
      play.setAttribute("aria-pressed", String(on));
      play.textContent = on ? "Pause" : "Play";
    };
    const turn = (by, up) => {
      angles = [angles[0] + by, Math.max(-Math.PI / 2, Math.min(Math.PI / 2, angles[1] + up))];
      draw();
    };
    const keys = {
      ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
      "+": () => { zoom *= 1.15; draw(); }, "-": () => { zoom /= 1.15; draw(); }, " ": toggle,
    };
    canvas.addEventListener("keydown", (event) => {
      if (keys[event.key]) {
        keys[event.key]();
        event.preventDefault();
      }
    });
    let held = null;
    canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      turn((held[0] - event.clientX) / 150, (event.clientY - held[1]) / 150);
      held = [event.clientX, event.clientY];
    });
    play.addEventListener("click", toggle);
    pick.addEventListener("change", choose);
    size.addEventListener("input", () => { draw(); tell(); });
    view.addEventListener("change", () => { angles = [...views[view.value]]; draw(); });
    named.checked = names.length <= 12;
    named.addEventListener("change", draw);
    new ResizeObserver(draw).observe(canvas);
    window.addEventListener("beforeprint", draw);
    const first = scene.shapes.findIndex((one) => largest(array(one.frames)) > 0 && !one.words.startsWith("free motion"));
    pick.value = String(Math.max(first, 0));
    choose();
  };

  document.querySelectorAll("figure.scene").forEach(made);
})();
