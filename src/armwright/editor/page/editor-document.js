// The texts of the two files, which are the only state of the page: a change in a form is a change of the text.

import { $ } from "./format.js";
import { post } from "./key.js";

const PAUSE = 300; // [ms] without a key before typed text is assessed
const MOST_UNDONE = 200; // changes that can be undone

let listener = () => {};
let typing = null;
let last = Promise.resolve(); // requests follow one another

export const opened = {
  files: null, // names of the files
  texts: null, // { task, space }
  saved: null, // likewise, as on disk; null if a file does not exist yet
  assessed: null, // what the server read in the texts
  shown: "task", // the file in the text field
  history: [],
  notes: null, // { task, space }: what saving a change does not keep
};

export async function ask(path, content) {
  let reply = null;
  try {
    reply = await post(path, content);
  } catch (fault) {
    if (fault.status) throw fault;
    throw new Error("The editor does not answer. Is `armwright edit` still running in the terminal?");
  }
  return reply.status === 204 ? null : reply.json();
}

// Runs a request after those before it; its failure is shown.
function next(request) {
  last = last.then(request).then(() => complain(""), (fault) => complain(fault.message));
  return last;
}

// Returns when all requests so far have been answered.
export const idle = () => last;

export function complain(message) {
  $("fault").hidden = message === "";
  $("fault").textContent = message;
}

export const isSaved = () => opened.texts.task === opened.saved?.task && opened.texts.space === opened.saved?.space;

// Begins with the server's files; `draw` is called whenever something has changed.
export function openDocument({ files, task, space, exist, notes }, draw) {
  const texts = { task, space };
  Object.assign(opened, { files, texts, notes, saved: exist ? texts : null });
  listener = draw;
  $("text").addEventListener("input", () => {
    clearTimeout(typing);
    typing = setTimeout(() => change({}), PAUSE);
  });
  $("text").value = texts[opened.shown];
  return change({});
}

// Changes keys of the files: { task: [edit, ...], space: [edit, ...] }.
export function change({ task = [], space = [] }) {
  return next(async () => {
    flush();
    const reply = await ask("assess", { ...opened.texts, task_edits: task, space_edits: space });
    if (reply.texts.task !== opened.texts.task || reply.texts.space !== opened.texts.space) remember(reply.texts);
    opened.assessed = reply;
    listener();
  });
}

// Takes typed text that has not been assessed yet.
function flush() {
  clearTimeout(typing);
  const typed = $("text").value;
  if (typed !== opened.texts[opened.shown]) remember({ ...opened.texts, [opened.shown]: typed });
}

function remember(texts) {
  opened.history = [...opened.history.slice(-MOST_UNDONE), opened.texts];
  opened.texts = texts;
}

export function undo() {
  return next(async () => {
    flush();
    opened.texts = opened.history.pop() ?? opened.texts;
    $("text").value = opened.texts[opened.shown];
    opened.assessed = await ask("assess", opened.texts);
    listener();
  });
}

export function show(file) {
  return next(async () => {
    flush();
    opened.shown = file;
    $("text").value = opened.texts[file];
    $("text").scrollTop = 0;
    listener();
  });
}

// Sends the texts to be written; asks before it replaces a file that somebody else has changed.
function write(path, content = {}) {
  return next(async () => {
    flush();
    const texts = opened.texts;
    try {
      await ask(path, { ...texts, ...content });
    } catch (fault) {
      if (!fault.message.includes("has changed on disk")) throw fault;
      if (!confirm(`${fault.message}. Replace it by the text of this page?`)) throw fault;
      await ask(path, { ...texts, ...content, overwrite: true });
    }
    for (const file of ["task", "space"]) if (texts[file] !== opened.saved?.[file]) opened.notes[file] = "";
    opened.saved = texts;
    listener();
  });
}

export const save = () => write("save");
export const design = (seconds) => write("design", { seconds });
