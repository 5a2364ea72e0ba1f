// Formats of numbers, and elements. Text is never markup, so names and answers are safe.

export const $ = (id) => document.getElementById(id);

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") made.className = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

// A coloured dot, as in legends.
export function dot(paint) {
  const made = element("span", { class: "dot" });
  made.style.background = paint;
  return made;
}

// Marks the rows of the chosen design or target, by the number in their data attribute; returns the row that is.
export function markRows(rows, name, chosen) {
  let found = null;
  for (const row of rows) {
    const isChosen = Number(row.dataset[name]) === chosen;
    row.classList.toggle("chosen", isChosen);
    row.setAttribute("aria-current", isChosen);
    if (isChosen) found = row;
  }
  return found;
}

export function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (Math.abs(value) < 1e-12) return "0";
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-4 ? value.toExponential(2) : String(Number(value.toPrecision(digits)));
}

export const percent = (share, digits = 1) => `${(100 * share).toFixed(digits)} %`;
export const millimetres = (metres) => (Math.abs(metres) >= 1 ? `${number(metres, 3)} m` : `${number(1000 * metres, 3)} mm`);
export const plural = (n, word) => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : "s"}`;

// Metres to a tenth of a millimetre, so that columns align.
export const metres = (value) => value.toFixed(4).replace(/^-(?=[0.]+$)/, "");

export const isTouched = () => matchMedia("(pointer: coarse)").matches;

const FINEST = { m: 1e-6, rad: 1e-5, "N m": 1e-4, kg: 1e-4 }; // below which a value is practically 0

// A value with its unit, in the digits that an engineer reads.
export function quantity(value, unit) {
  if (value === null || value === undefined || Number.isNaN(value)) return "not known";
  const finest = FINEST[unit] ?? 0;
  if (value !== 0 && Math.abs(value) < finest) return `< ${quantity(finest, unit)}`;
  switch (unit) {
    case "m": return millimetres(value);
    case "rad": return `${number((180 * value) / Math.PI, 3)}°`;
    case "of allowed": return `${percent(value, 0)} of allowed`;
    case "fraction": return percent(value, 0);
    case "USD": return `${Math.round(value).toLocaleString("en")} USD`;
    case "targets": case "joints": case "voltages": return `${number(value, 3)} ${value === 1 ? unit.slice(0, -1) : unit}`;
    default: return `${number(value, 3)} ${unit.replace(" x ", " × ")}`;
  }
}

// A question mark that opens an explanation.
export function why(name, text) {
  const summary = element("summary", { "aria-label": `What is ${name}?`, title: text }, "?");
  return element("details", { class: "why" }, summary, element("p", {}, text));
}

export function duration(seconds) {
  if (seconds < 1) return `${Math.round(1000 * seconds)} ms`;
  if (seconds < 90) return `${seconds < 10 ? seconds.toFixed(1) : Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

// Escapes the tags that Plotly interprets.
export const plain = (text) => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

export const heading = ({ label, unit }) => label + (unit ? ` [${unit.replace(" x ", " × ")}]` : "");
export const title = (objective) => plain(heading(objective));

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// Calls the listener when the colour scheme changes.
export function onTheme(listener) {
  for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", listener);
}

// Nearly black colours become nearly white in a dark scheme.
export const shown = (paint) => (paint === "#111111" || paint === "#000000" ? colour("ink") : paint);

export function save(name, text, type) {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
