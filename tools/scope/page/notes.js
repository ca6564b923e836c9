// SPDX-License-Identifier: Apache-2.0
// Notes of the user's, which the daemon records with their time, if the server takes them.

import { byId, setText } from "./elements.js";

export class Notes {
  constructor(app) {
    this.app = app;
    this.form = byId("note-form");
    this.field = byId("note");
    this.answer = byId("note-answer");
    this.waits = false; // for the daemon's answer
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send();
    });
  }

  allow(allowed) {
    this.form.hidden = !allowed;
    this.waits = false; // of an earlier connection
  }

  focus() { if (!this.form.hidden) this.field.focus(); }

  #send() {
    const note = this.field.value.trim();
    if (note === "" || this.waits) return;
    this.waits = this.app.stream.send({ note });
    this.#show(this.waits ? "" : "Not connected: the note was not taken.");
  }

  // The daemon's answer.
  take({ taken, refusal }) {
    this.waits = false;
    if (taken) this.field.value = "";
    this.#show(taken ? "Noted." : `Not taken: ${refusal}`);
    this.app.say(this.answer.textContent);
  }

  #show(words) { setText(this.answer, words); }
}
