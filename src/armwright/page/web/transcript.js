// The calls to the model for the selected design, or for all.

import { listen, state } from "./state.js";
import { $, duration, element, number } from "./format.js";

const STEPS = { reasoning: "reasoning", parameters: "parameters from the reasoning", answer: "answer", check: "check" };

let content = null;

export function openTranscript(shownContent) {
  content = shownContent;
  $("all-calls").addEventListener("change", drawTranscript);
  listen((changed) => { if (changed.has("design")) drawTranscript(); });
  drawTranscript();
}

function drawTranscript() {
  const all = $("all-calls").checked, proposed = Object.keys(content.proposals).length;
  $("transcript-box").hidden = proposed === 0 && content.calls.length === 0;
  $("all-calls").parentElement.hidden = content.calls.length === 0;
  const calls = all ? content.calls : state.design === null ? [] : content.callsOf(state.design);
  const parts = [];
  if (!all) parts.push(element("p", {}, describeProposal()));
  parts.push(...calls.map((call) => callElement(call, all)));
  const key = `${all} ${state.design} ${calls.length}`; // unchanged elements stay, so that an opened prompt stays open
  if (key === $("transcript").dataset.key) return;
  $("transcript").dataset.key = key;
  $("transcript").replaceChildren(...parts);
}

function describeProposal() {
  const i = state.design, proposal = content.proposals[i];
  if (i === null) return "Select a design.";
  if (proposal?.fault) return `The proposal for #${i} failed (${proposal.fault}); the black box replaced it.`;
  if (proposal?.screened) return `${proposal.screened}. #${i} is the black box's design instead.`;
  if (!proposal) return `#${i}, source: ${content.look(i).label}; no reason is given.`;
  return `#${i}, by ${content.look(i).label}: ${proposal.reason || "no reason is given"}.`.replace("..", ".");
}

function callElement(call, inList) {
  const cost = call.cost_usd ? `, ${number(call.cost_usd, 2)} USD` : "";
  const head = [
    `${call.proposal || "before the first trial"}, ${STEPS[call.step] ?? call.step}: ${call.model || call.origin}`,
    call.origin === "model" ? "" : ` (${call.origin})`,
    `, ${duration(call.seconds)}, ${call.input_tokens} tokens in, ${call.output_tokens} out${cost}`,
    call.fault ? `; failed: ${call.fault}` : "",
  ].join("");
  const made = element("div", { class: "call" }, element("strong", {}, head));
  if (inList) made.append(...content.screenedOf(call).map((text) => element("p", {}, text)));
  if (call.error) made.append(element("p", { class: "missed" }, call.error));
  for (const [name, text, open] of [["Answer", call.answer, true], ["Prompt", call.prompt, false]]) {
    if (text) made.append(element("details", { open }, element("summary", {}, name), element("pre", {}, text)));
  }
  return made;
}
