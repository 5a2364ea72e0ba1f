// Draws a task and its design space beside their files, and starts searches.

import { drawLoad, drawObstacles, openObstacles } from "./editor-bodies.js";
import { drawCycle, openCycle } from "./editor-cycle.js";
import { change, complain, idle, isSaved, openDocument, opened, save, show, undo } from "./editor-document.js";
import { openJob } from "./editor-job.js";
import { drawScene, openScene, targetPlaces } from "./editor-scene.js";
import { drawMotors, drawSpace, openMotors } from "./editor-space.js";
import { drawTargets, openTargets } from "./editor-targets.js";
import { drawWants, openWants } from "./editor-wants.js";
import { $, element, plural } from "./format.js";
import { openKey, request } from "./key.js";

function draw() {
  const field = $("text"), { assessed, texts, shown } = opened;
  if (field.value !== texts[shown]) {
    const top = field.scrollTop;
    field.value = texts[shown];
    field.scrollTop = top;
  }
  $("file-name").textContent = opened.files[shown];
  $("file-note").textContent = `${opened.notes.task} ${opened.notes.space}`.trim();
  for (const button of $("files").children) button.setAttribute("aria-pressed", button.dataset.file === shown);
  $("saved").textContent = isSaved() ? "saved" : "not saved";
  $("save").disabled = isSaved();
  $("undo").disabled = !opened.history.length;
  drawCheck(assessed);
  drawForms();
  drawScene();
}

// Forms whose file cannot be read stay as they are.
function drawForms() {
  const forms = { task: [drawTargets, drawCycle, drawLoad, drawObstacles, drawWants], space: [drawSpace, drawMotors] };
  for (const [file, drawing] of Object.entries(forms)) if (opened.assessed[file] !== null) for (const form of drawing) form();
}

function drawCheck({ errors, findings, meaning }) {
  $("verdict").textContent = errors.length ? "No search can start yet"
    : findings.length ? `Ready, with ${plural(findings.length, "warning")}` : "Ready";
  $("verdict").className = errors.length ? "missed" : "passed";
  $("findings").replaceChildren(
    ...errors.map((text) => element("li", { class: "missed" }, text)),
    ...findings.map(({ message, evidence }) => element("li", {}, `${message} (${evidence})`)),
  );
  $("meaning").replaceChildren(...Object.entries(meaning).flatMap(([name, text]) => [element("dt", {}, name), element("dd", {}, text)]));
}

function listenToKeys() {
  for (const button of $("files").children) button.addEventListener("click", () => show(button.dataset.file));
  $("save").addEventListener("click", save);
  $("undo").addEventListener("click", undo);
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key !== "s") return;
    event.preventDefault();
    save();
  });
  addEventListener("beforeunload", (event) => {
    if (!isSaved()) event.preventDefault();
  });
}

async function start() {
  try {
    openKey();
    const reply = await (await request("opened")).json();
    document.title = `${reply.files.task}: armwright`;
    $("title").textContent = reply.files.task;
    for (const open of [openTargets, openCycle, openObstacles, openWants, openMotors]) open(reply.choices);
    $("unit").addEventListener("change", drawForms);
    openScene();
    openJob();
    listenToKeys();
    await openDocument(reply, draw);
    $("loading").hidden = true;
  } catch (fault) {
    $("loading").textContent = `This page cannot be shown: ${fault.message}`;
    throw fault;
  }
}

// For the console and for tests.
window.armwright = { change, complain, idle, opened, targetPlaces };
start();
