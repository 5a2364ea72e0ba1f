// The page of a run in progress: fetches new content from its server, and sends requests of the user.

import { $, duration, element, plural } from "./format.js";

const AGAIN = 1000; // [ms] between attempts to reach a lost server

let content = null;
let take = null;
let token = "";
let status = null;
let beside = null; // state of the reach maps and existing arms that the page shows
let busy = false, behind = false, lost = false;

// Fetches the part of the run that the page lacks.
async function fetchRun() {
  const reply = await fetch(`run?designs=${content.n}&calls=${content.calls.length}`);
  if (!reply.ok) throw new Error(await reply.text());
  return reply.arrayBuffer();
}

// Fetches the file of a design that the page does not hold; null offline.
export function fileFetcher() {
  if ($("content")) return null;
  return async (design, format) => {
    const reply = await fetch(`file?design=${design}&format=${format}`);
    if (!reply.ok) throw new Error(await reply.text());
    return reply.text();
  };
}

export function openLive(shownContent, taken) {
  [content, take] = [shownContent, taken];
  token = document.querySelector("meta[name=armwright-token]").content;
  $("live").hidden = false;
  $("loading").textContent = "The first designs are being evaluated …";
  $("pause").addEventListener("click", () => send({ action: status?.paused ? "resume" : "pause" }));
  $("stop").addEventListener("click", () => send({ action: "stop" }));
  $("hint").addEventListener("submit", async (event) => {
    event.preventDefault();
    const text = $("hint-text").value.trim();
    if (text && (await send({ action: "hint", text }))) $("hint-text").value = "";
  });
  // A browser allows six connections to a server over all its tabs, so hidden tabs disconnect.
  listenTo();
  document.addEventListener("visibilitychange", listenTo);
  setInterval(show, 1000); // updates the elapsed seconds
}

let events = null;

function listenTo() {
  events?.close();
  events = null;
  if (document.hidden) return;
  events = new EventSource("events"); // reconnects automatically
  events.addEventListener("status", (event) => {
    lost = false;
    const before = status;
    status = JSON.parse(event.data);
    if (before !== null && before.run !== status.run) { // another run in this folder, or at this address
      location.reload();
      return;
    }
    show();
    const isNews = status.designs !== content.n || status.calls !== content.calls.length
      || status.finished !== content.head?.result.finished || status.beside !== beside;
    if (isNews && (status.designs || content.n)) catchUp();
  });
  events.addEventListener("error", () => {
    lost = true;
    show();
  });
}

async function catchUp() {
  if (busy) {
    behind = true;
    return;
  }
  busy = true;
  let news = null;
  const fetched = status.beside;
  try {
    news = await fetchRun();
    beside = fetched;
  } catch {
    setTimeout(catchUp, AGAIN);
  }
  busy = false;
  if (news !== null) take(news);
  if (behind) {
    behind = false;
    catchUp();
  }
}

async function send(request) {
  try {
    const reply = await fetch("control", {
      method: "POST", headers: { "content-type": "application/json", "x-armwright-token": token }, body: JSON.stringify(request),
    });
    complain("refusal", reply.ok ? "" : `Refused: ${await reply.text()}.`);
    return reply.ok;
  } catch {
    complain("refusal", "The request did not reach the server.");
    return false;
  }
}

function complain(id, message) {
  $(id).hidden = message === "";
  $(id).textContent = message;
}

const since = () => duration(Math.max(0, Date.now() / 1000 - status.since));

function doing() {
  switch (status.doing) {
    case "asking": return `asking the ${status.takes_hints ? "model" : "proposer"}, ${since()}`;
    case "evaluating":
      return status.designs < status.planned ? `evaluating ${status.designs + 1} of ${status.planned}` : "writing the results";
    case "paused": return `paused for ${since()}, at ${status.designs} of ${status.planned}`;
    case "stopped": return `stopped at ${status.designs} of ${status.planned}; repeat the command to resume`;
    case "searching": return "searching; its designs appear when the search ends";
    case "finished": return `finished: ${plural(status.designs, "design")}`;
    default: return `not running, at ${status.designs}${status.planned ? ` of ${status.planned}` : ""}`;
  }
}

function show() {
  const isOver = lost || !["asking", "evaluating", "paused"].includes(status?.doing);
  if (lost && status?.doing !== "finished") $("doing").textContent = "Connection lost; trying again …";
  else if (status !== null) $("doing").textContent = doing();
  if (status === null) return;
  $("progress").hidden = !status.planned;
  $("progress").max = status.planned || 1;
  $("progress").value = status.designs;
  $("left").textContent = isOver || status.left === null || status.left < 1 ? "" : `about ${duration(status.left)} left`;
  $("pause").hidden = $("stop").hidden = !lost && isOver;
  $("pause").disabled = $("stop").disabled = lost;
  $("pause").setAttribute("aria-pressed", status.paused);
  $("pause").textContent = status.paused ? "Resume" : "Pause";
  $("hint").hidden = !status.takes_hints || isOver;
  complain("fault", status.fault ? `last fault: ${status.fault}` : "");
  const used = status.hints.filter((hint) => hint.used !== null), waiting = status.hints.filter((hint) => hint.used === null);
  $("hints").replaceChildren(...[...used.slice(-1), ...waiting].map((hint) => element("li", {},
    hint.used === null ? "waiting for the next prompt: " : `used at iteration ${hint.used}: `, element("em", {}, hint.text))));
}
