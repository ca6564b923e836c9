// Small things about the document.

export const byId = (id) => document.getElementById(id);

// Writes a text only where it is another: the document is not laid out anew for nothing.
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

// Rows of a <dl>, made when they are first named; set(name, text, state) writes one.
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

// Whether an element can be seen at all; what cannot is not drawn.
export function watchVisible(elements, changed) {
  const visible = new Map(elements.map((element) => [element, true]));
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) visible.set(entry.target, entry.isIntersecting);
    changed?.();
  }, { rootMargin: "80px" });
  for (const element of elements) observer.observe(element);
  return (element) => visible.get(element) === true;
}
