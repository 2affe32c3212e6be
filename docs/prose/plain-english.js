// Rule of textlint: patterns that plain English avoids (rules.json), and long sentences.
const rules = require("./rules.json").map((rule) => ({ ...rule, regex: new RegExp(rule.pattern, "g") }));
const LONGEST = 40; // words of a sentence

// The text of a paragraph with its offsets: code, links and markup become x and spaces of the same length.
function proseOf(node, source) {
  const start = node.range[0];
  const text = Array.from(source, (character) => (/\s/.test(character) ? " " : "\0"));
  (function copy(part) {
    const [from, to] = [part.range[0] - start, part.range[1] - start];
    if (part.type === "Str") {
      for (let i = from; i < to; i++) text[i] = /\s/.test(source[i]) ? " " : source[i];
    } else if (part.type === "Code") {
      text.fill("x", from, to);
    }
    (part.children || []).forEach(copy);
  })(node);
  return text.join("").replace(/\0+/g, (gap) => " ".repeat(gap.length));
}

module.exports = ({ Syntax, RuleError, getSource, locator, report }) => {
  const check = (node) => {
    const text = proseOf(node, getSource(node));
    const complain = (from, to, message) =>
      report(node, new RuleError(message, { padding: locator.range([from, to]) }));
    for (const { regex, say } of rules) {
      for (const match of text.matchAll(regex)) {
        complain(match.index, match.index + match[0].length, `"${match[0].trim()}": ${say}`);
      }
    }
    if (node.type !== Syntax.Paragraph || text.includes("====")) return; // a table of a docstring
    for (const sentence of text.matchAll(/\S.*?(?:[.!?](?=\s|$)|$)/g)) {
      const words = sentence[0].split(/\s+/).filter((word) => /[A-Za-z]{2}/.test(word)).length;
      if (words > LONGEST) {
        complain(sentence.index, sentence.index + sentence[0].length, `${words} words: make it two sentences`);
      }
    }
  };
  return { [Syntax.Paragraph]: check, [Syntax.Header]: check, [Syntax.TableCell]: check };
};
