// What the surrogate of a finished run learned of each objective.

import { $, element, number, percent } from "./format.js";

const COLUMNS = ["Objective", "Variance explained", "Median error", "Predicted most by", "Compared with our physics"];
const CLASSES = ["text", null, null, "text wrap", "text wrap"];

export function drawSurrogate(content) {
  const learned = content.head.result.surrogate;
  $("surrogate-box").hidden = !learned;
  if (!learned) return;
  const row = (cells, tag) => element("tr", {}, ...cells.map((cell, i) => element(tag, CLASSES[i] ? { class: CLASSES[i] } : {}, cell)));
  const rows = learned.objectives.map((one) => row([
    one.name,
    one.explained === null ? "constant" : percent(one.explained, 0),
    one.relative_error === null ? "–" : `${number(100 * one.relative_error, 2)} %`,
    one.effects.map((effect) => `${effect.name.replaceAll("_", " ")} (${percent(effect.share, 0)})`).join(", ") || "–",
    one.correction || "–",
  ], "td"));
  $("surrogate").replaceChildren(element("thead", {}, row(COLUMNS, "th")), element("tbody", {}, ...rows));
  $("surrogate-note").textContent =
    `Each of ${learned.designs} designs was predicted from all others. Variance explained: of the objective or its logarithm, ` +
    "whichever the surrogate uses. In brackets: the share of the variance that a permutation of the input changes.";
}
