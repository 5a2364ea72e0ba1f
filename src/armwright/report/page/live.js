// The same page while the run goes on: asks its server for what is new, and sends what the user wants.

import { $, duration, element } from "./words.js";

const AGAIN = 1000; // ms until a lost server is asked again

let content = null;
let take = null;
let token = "";
let status = null;
let busy = false, behind = false;

// The part of the run that the page lacks.
async function fetchRun() {
  const reply = await fetch(`run?designs=${content.n}&calls=${content.calls.length}`);
  if (!reply.ok) throw new Error(await reply.text());
  return reply.arrayBuffer();
}

// How a design's file is got where the page does not hold it; null offline.
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
  const events = new EventSource("events"); // asks again by itself when the connection is lost
  events.addEventListener("status", (event) => {
    status = JSON.parse(event.data);
    show();
    const isNews = status.designs !== content.n || status.calls !== content.calls.length
      || status.finished !== content.head?.result.finished;
    if (isNews && (status.designs || content.n)) catchUp();
  });
  events.addEventListener("error", () => {
    if (status === null || status.doing !== "finished") $("doing").textContent = "No connection to the run; trying again …";
  });
  setInterval(show, 1000); // the seconds of what goes on
}

async function catchUp() {
  if (busy) {
    behind = true;
    return;
  }
  busy = true;
  try {
    take(await fetchRun());
  } catch (fault) {
    $("doing").textContent = `No connection to the run (${fault.message}); trying again …`;
    setTimeout(catchUp, AGAIN);
  }
  busy = false;
  if (behind) {
    behind = false;
    catchUp();
  }
}

async function send(wish) {
  const reply = await fetch("control", {
    method: "POST", headers: { "content-type": "application/json", "x-armwright-token": token }, body: JSON.stringify(wish),
  });
  complain(reply.ok ? "" : await reply.text());
  return reply.ok;
}

function complain(words) {
  $("fault").hidden = words === "";
  $("fault").textContent = words;
}

const since = () => duration(Math.max(0, Date.now() / 1000 - status.since));

function doing() {
  switch (status.doing) {
    case "asking": return `asking the model, ${since()}`;
    case "evaluating": return `evaluating ${Math.min(status.designs + 1, status.planned)} of ${status.planned}`;
    case "paused": return `paused for ${since()}, at ${status.designs} of ${status.planned}`;
    case "stopped": return `stopped at ${status.designs} of ${status.planned}; the same command goes on`;
    case "finished": return `finished: ${status.designs} designs`;
    default: return `not running, at ${status.designs}${status.planned ? ` of ${status.planned}` : ""}`;
  }
}

function show() {
  if (status === null) return;
  const isOver = !["asking", "evaluating", "paused"].includes(status.doing);
  $("doing").textContent = doing();
  $("progress").hidden = !status.planned;
  $("progress").max = status.planned || 1;
  $("progress").value = status.designs;
  $("left").textContent = isOver || status.left === null ? "" : `about ${duration(status.left)} left`;
  $("pause").disabled = $("stop").disabled = isOver;
  $("pause").setAttribute("aria-pressed", status.paused);
  $("pause").textContent = status.paused ? "Resume" : "Pause";
  $("hint").hidden = !status.takes_hints || isOver;
  complain(status.fault ? `last fault: ${status.fault}` : "");
  $("hints").replaceChildren(...status.hints.map((hint) => element("li", {},
    hint.used === null ? "waits for the next question: " : `used at iteration ${hint.used}: `, element("em", {}, hint.text))));
}
