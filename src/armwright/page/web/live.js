// The page of a run in progress: fetches new content from its server, and sends requests of the user.

import { $, duration, element, plural } from "./format.js";
import { openKey, post, request } from "./key.js";

const AGAIN = 1000; // [ms] between attempts to reach a lost server

let content = null;
let take = null;
let status = null;
let beside = null; // state of the reach maps and existing arms that the page shows
let busy = false, behind = false, lost = false;

// Fetches the part of the run that the page lacks.
async function fetchRun() {
  return (await request(`run?designs=${content.n}&calls=${content.calls.length}`)).arrayBuffer();
}

// Fetches the file of a design that the page does not hold; null offline.
export function fileFetcher() {
  if ($("content")) return null;
  return async (design, format) => (await request(`file?design=${design}&format=${format}`)).text();
}

export function openLive(shownContent, taken) {
  [content, take] = [shownContent, taken];
  openKey();
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

let listening = new AbortController();

// Follows the status while the tab is visible; not by an EventSource, which cannot send the key.
async function listenTo() {
  listening.abort();
  if (document.hidden) return;
  listening = new AbortController();
  const { signal } = listening;
  while (!signal.aborted) {
    try {
      // Out of this function, so that no fault of the page is taken for a lost connection.
      await readLines(await request("events", { signal }), (line) => queueMicrotask(() => takeStatus(JSON.parse(line))));
    } catch (fault) {
      if (signal.aborted) return;
      if (fault.status === 403) {
        $("loading").textContent = `This page cannot be shown: ${fault.message}`;
        complain("refusal", fault.message);
        return;
      }
    }
    lost = true;
    show();
    await new Promise((next) => setTimeout(next, AGAIN));
  }
}

async function readLines(reply, listener) {
  const reader = reply.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    const lines = (rest + part.value).split("\n");
    rest = lines.pop();
    lines.forEach(listener);
  }
}

function takeStatus(news) {
  lost = false;
  const before = status;
  status = news;
  if (before !== null && before.run !== status.run) { // another run in this folder
    location.reload();
    return;
  }
  document.title = `${status.name}: armwright, live`;
  show();
  const isNews = status.designs !== content.n || status.calls !== content.calls.length
    || status.finished !== content.head?.result.finished || status.beside !== beside;
  if (isNews && (status.designs || content.n)) catchUp();
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
  } catch (fault) {
    if (fault.status !== 403) setTimeout(catchUp, AGAIN);
  }
  busy = false;
  if (news !== null) take(news);
  if (behind) {
    behind = false;
    catchUp();
  }
}

async function send(action) {
  try {
    await post("control", action);
    complain("refusal", "");
    return true;
  } catch (fault) {
    complain("refusal", fault.status ? `Refused: ${fault.message}` : "The request did not reach the server.");
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
