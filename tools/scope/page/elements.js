// SPDX-License-Identifier: Apache-2.0
// Access to elements of the document.

export const byId = (id) => document.getElementById(id);

// Sets a text if it differs, to avoid needless layout.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setState(element, state) {
  if (element.dataset.state !== state) element.dataset.state = state;
}

export function setPressed(button, pressed) {
  button.setAttribute("aria-pressed", pressed ? "true" : "false");
}

// options: pairs of value and text.
export function fillSelect(select, options, chosen) {
  select.replaceChildren(...options.map(([value, text]) => new Option(text, value, false, String(value) === String(chosen))));
}

export function tableRow(heading, cells) {
  const row = document.createElement("tr");
  const head = document.createElement("th");
  head.scope = "row";
  if (typeof heading === "string") head.textContent = heading;
  else head.append(heading);
  row.append(head);
  for (let i = 0; i < cells; ++i) row.insertCell().className = "number";
  return row;
}

// Rows of a <dl>, created on first use; set(name, text, state) updates one.
export class Facts {
  #rows = new Map();

  constructor(list) { this.list = list; }

  set(name, text, state = "") {
    let value = this.#rows.get(name);
    if (!value) {
      const term = document.createElement("dt");
      term.textContent = name;
      value = document.createElement("dd");
      this.list.append(term, value);
      this.#rows.set(name, value);
    }
    setText(value, text);
    setState(value, state);
  }
}

// True if an element is visible; others are not drawn.
export function watchVisible(elements, changed) {
  const visible = new Map(elements.map((element) => [element, true]));
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) visible.set(entry.target, entry.isIntersecting);
    changed?.();
  }, { rootMargin: "80px" });
  for (const element of elements) observer.observe(element);
  return (element) => visible.get(element) === true;
}
