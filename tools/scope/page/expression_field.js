// SPDX-License-Identifier: Apache-2.0
// The field of the user's expression, whose lane appears when it is valid.

import { byId, setState, setText } from "./elements.js";
import { compile, symbols } from "./expression.js";

export class ExpressionField {
  constructor(app, lane, text) {
    this.app = app;
    this.lane = lane;
    this.text = ""; // as it is in use
    this.field = byId("expression");
    this.note = byId("expression-note");
    this.field.addEventListener("change", () => this.set(this.field.value));
    this.set(text, lane.wanted);
  }

  // An expression with an error is not used, and the one before stays.
  set(text, wanted = text.trim() !== "") {
    this.field.value = text;
    try {
      const compiled = compile(text);
      for (const store of [this.app.live, this.app.frozen]) store?.frames.setExpression(compiled);
      this.text = text.trim();
      this.#show("", `of ${symbols.join(", ")} in SI units`);
    } catch (error) {
      if (error.at === undefined) throw error;
      this.#show("bad", `Character ${error.at + 1}: ${error.message}.`);
      if (document.activeElement === this.field) this.field.setSelectionRange(error.at, error.at + 1);
      return;
    }
    this.lane.name = this.text;
    this.app.scope?.renewLane(this.lane, wanted);
    this.app.scope?.keep();
  }

  #show(state, words) {
    setText(this.note, words);
    setState(this.note, state);
    this.field.setAttribute("aria-invalid", state === "bad" ? "true" : "false");
  }
}
