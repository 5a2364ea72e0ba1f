// Fields of forms. A field whose text is no number is marked and changes nothing.

import { change, opened } from "./editor-document.js";
import { $, element } from "./format.js";

const DEGREE = Math.PI / 180;

// Returns metres per unit of the lengths in forms.
export const unit = () => Number($("unit").value);
export const unitName = () => (unit() === 1 ? "m" : "mm");

export const list = (value) => (Array.isArray(value) ? value : []);
export const record = (value) => (value !== null && typeof value === "object" && !Array.isArray(value) ? value : {});
export const task = () => record(opened.assessed.task);
export const isNumber = (value) => typeof value === "number" || (typeof value === "string" && value.trim() !== "" && Number.isFinite(Number(value)));

// A factor turns a number of a form into one of the file.
export const plainNumber = { factor: () => 1, digits: 9 };
export const length = { factor: unit, digits: 9 };
export const angle = { factor: () => DEGREE, digits: 5 };

const tidy = (value, digits = 9) => Number(value.toPrecision(digits));

// Returns the number that a text means, a decimal comma included; NaN for none.
export function numberOf(text) {
  const trimmed = text.trim().replace(",", ".");
  return trimmed === "" ? NaN : Number(trimmed);
}

// Returns a text field for a number of the file. `edit` returns the change { task, space } for a new number, or for
// null if the field was cleared and may be.
export function numberField({ id, value, kind = plainNumber, label, size = 7, optional = false, edit }) {
  const shown = isNumber(value) ? String(tidy(Number(value) / kind.factor(), kind.digits)) : value === null || value === undefined ? "" : String(value);
  const field = element("input", { type: "text", inputmode: "decimal", id, size, "aria-label": label, autocomplete: "off" });
  field.value = shown;
  field.addEventListener("change", () => {
    const text = field.value.trim(), given = numberOf(text);
    const isFine = Number.isFinite(given) || (optional && text === "");
    field.setAttribute("aria-invalid", !isFine);
    if (isFine && text !== shown) change(edit(text === "" ? null : tidy(given * kind.factor())));
  });
  return field;
}

export function textField({ id, value, label, size = 12, edit }) {
  const field = element("input", { type: "text", id, size, "aria-label": label, autocomplete: "off" });
  field.value = value ?? "";
  field.addEventListener("change", () => change(edit(field.value.trim())));
  return field;
}

// options: [value, text] pairs.
export function choiceField({ id, value, options, label, edit }) {
  const field = element("select", { id, "aria-label": label }, ...options.map(([key, text]) => element("option", { value: key }, text)));
  field.value = value;
  field.addEventListener("change", () => change(edit(field.value)));
  return field;
}

export const button = (text, press, attributes = {}) => element("button", { type: "button", onclick: press, ...attributes }, text);

export const removal = (label, edit) => button("✕", () => change(edit()), { class: "quiet", "aria-label": `Remove ${label}`, title: `Remove ${label}` });

// Returns what adds a line to a form: its name and its parts.
export const formLine = (fields) => (name, ...parts) => fields.push(element("span", {}, name), element("span", { class: "fields" }, ...parts));

// A word between fields.
export const word = (text) => element("span", {}, text);

// Replaces the content of a form, and keeps the focus on the field of the same id.
export function redraw(place, ...children) {
  const focused = document.activeElement?.id;
  place.replaceChildren(...children);
  if (focused && place.contains($(focused))) $(focused).focus();
}

// Returns one edit: a new value, or a removal for null.
export const set = (path, value) => (value === null ? { path, remove: true } : { path, value });
