// The title of the run, its key figures and its configuration.

import { isForEngineers } from "./recommended.js";
import { $, dot, duration, element, number, percent, plural } from "./format.js";

let content = null;

export function openHeader(shownContent) {
  content = shownContent;
  const copy = $("repeat").querySelector("button");
  copy.hidden = navigator.clipboard === undefined;
  copy.addEventListener("click", async () => {
    await navigator.clipboard.writeText(content.head.command);
    copy.textContent = "Copied";
  });
  drawHeader();
}

const fact = (name, value, paint) => element("li", {}, paint ? dot(paint) : null, `${name} `, element("b", {}, value));

function drawHeader() {
  const { head } = content, { result } = head, facts = [], research = isForEngineers(head) ? [] : facts;
  $("title").textContent = `${head.config.task.name}: ${head.method}, seed ${head.config.seed}`;
  $("description").textContent = head.config.task.description;
  $("repeat").hidden = head.command === "";
  $("repeat").querySelector("code").textContent = head.command;
  if (!result.finished) facts.push(fact("state", "unfinished"));
  if (result.hypervolume !== null) {
    const share = head.best_known ? ` (${percent(result.hypervolume / head.best_known)} of the best known)` : "";
    research.push(fact("hypervolume", `${number(result.hypervolume)}${share}`));
    research.push(fact("reference point", `(${head.reference_point.map((v) => number(v)).join(", ")})`));
  }
  const good = result.verdict === null ? "" : `, ${result.verdict.numbers.length} ${result.verdict.good.replace("holds", "hold")}`;
  facts.push(fact("front", `${plural(head.front.length, "design")}${good}`));
  if (head.result.failed) facts.push(fact("failed evaluations", `${head.result.failed}`));
  if (head.result.infeasible) facts.push(fact("infeasible", `${head.result.infeasible}`));
  for (const [source, n] of Object.entries(result.by_source)) {
    facts.push(fact(head.looks[source].label, `${n}`, head.looks[source].colour));
  }
  if (result.evaluations > content.n) facts.push(fact("evaluations", result.evaluations.toLocaleString("en")));
  if (result.seconds > 0) facts.push(fact("time", duration(result.seconds)));
  if (content.calls.length) {
    const calls = content.calls.reduce((sum, call) => sum + Math.max(1, call.requests), 0);
    const costs = content.calls.map((call) => call.cost_usd).filter((cost) => cost !== null);
    const cost = costs.length ? `, ${number(costs.reduce((a, b) => a + b, 0), 3)} USD` : "";
    const stand_in = content.calls.some((call) => call.origin === "scripted") ? ", by a scripted stand-in" : "";
    facts.push(fact("calls to the model", `${calls}${cost}${stand_in}`));
  }
  $("facts").replaceChildren(...facts);
  $("research").hidden = research === facts || !research.length;
  if (research !== facts) $("research").replaceChildren(...research);
}

export function drawConfiguration() {
  const { head } = content, list = element("dl");
  const tell = (name, value) => list.append(element("dt", {}, name), element("dd", {}, value));
  const walk = (name, value) => {
    if (value !== null && typeof value === "object" && !Array.isArray(value)) {
      for (const [key, inner] of Object.entries(value)) walk(name ? `${name}.${key}` : key, inner);
    } else tell(name, Array.isArray(value) ? JSON.stringify(value) : String(value));
  };
  walk("", head.config);
  $("configuration-box").hidden = false;
  $("configuration").replaceChildren(element("p", { class: "note" }, `Run folder ${head.folder}. ${head.masses}.`), list);
  $("footer").textContent = `Made by armwright ${head.config.versions.armwright ?? ""} from the run folder ${head.folder}. This file works without a network.`;
}
