// SPDX-License-Identifier: Apache-2.0
// An expression of the user's over the channels: a parser by recursive descent, whose result is functions
// within functions. Nothing of the text is ever run as a script. The grammar is that of the formulas of models.

// Symbols in the order of the array that a compiled expression takes, in SI units.
export const symbols = ["x", "v", "F", "N", "b", "D", "mu", "P", "t"];
const constants = { pi: Math.PI };
const functions = {
  abs: [1, Math.abs], sign: [1, Math.sign], exp: [1, Math.exp], log: [1, Math.log], sqrt: [1, Math.sqrt],
  sin: [1, Math.sin], cos: [1, Math.cos], tan: [1, Math.tan], tanh: [1, Math.tanh],
  min: [2, Math.min], max: [2, Math.max], pow: [2, Math.pow],
};
const longest = 200; // characters

// `at`: place in the text, from 0.
export class ExpressionError extends Error {
  constructor(message, at) {
    super(message);
    this.at = at;
  }
}

function tokensOf(text) {
  const pattern = /\s*(?:((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|([A-Za-z_μ]\w*)|([-+*/^(),]))/y;
  const tokens = [];
  let end = text.trimEnd().length;
  for (let at = 0; at < end; at = pattern.lastIndex) {
    pattern.lastIndex = at;
    const match = pattern.exec(text);
    const start = at + /^\s*/.exec(text.slice(at))[0].length;
    if (match === null) throw new ExpressionError(`"${text[start]}" has no meaning here`, start);
    const [, value, name, sign] = match;
    tokens.push({ at: start, kind: value !== undefined ? "number" : name !== undefined ? "name" : sign, text: value ?? name ?? sign });
  }
  tokens.push({ at: end, kind: "end", text: "the end" });
  return tokens;
}

class Parser {
  constructor(text) {
    this.tokens = tokensOf(text);
    this.next = 0;
  }

  get token() { return this.tokens[this.next]; }

  // Takes the next token if it is of a kind.
  #take(...kinds) { return kinds.includes(this.token.kind) ? this.tokens[this.next++] : null; }

  #expect(kind, words = `"${kind}"`) {
    const token = this.#take(kind);
    if (token === null) throw this.#unexpected(words);
    return token;
  }

  #unexpected(words) {
    const { text, kind, at } = this.token;
    return new ExpressionError(`expected ${words}, not ${kind === "end" ? text : `"${text}"`}`, at);
  }

  whole() {
    const run = this.#sum();
    this.#expect("end", "an operator");
    return run;
  }

  #sum() {
    let left = this.#product();
    for (let sign = this.#take("+", "-"); sign !== null; sign = this.#take("+", "-")) {
      const [a, b] = [left, this.#product()];
      left = sign.kind === "+" ? (values) => a(values) + b(values) : (values) => a(values) - b(values);
    }
    return left;
  }

  #product() {
    let left = this.#signed();
    for (let sign = this.#take("*", "/"); sign !== null; sign = this.#take("*", "/")) {
      const [a, b] = [left, this.#signed()];
      left = sign.kind === "*" ? (values) => a(values) * b(values) : (values) => a(values) / b(values);
    }
    return left;
  }

  #signed() {
    if (this.#take("+")) return this.#signed();
    if (!this.#take("-")) return this.#power();
    const of = this.#signed();
    return (values) => -of(values);
  }

  // Binds most, and from the right: -x^2 is -(x^2), 2^3^2 is 2^9.
  #power() {
    const base = this.#primary();
    if (!this.#take("^")) return base;
    const exponent = this.#signed();
    return (values) => base(values) ** exponent(values);
  }

  #primary() {
    const number = this.#take("number");
    if (number) {
      const value = Number(number.text);
      return () => value;
    }
    if (this.#take("(")) {
      const inner = this.#sum();
      this.#expect(")");
      return inner;
    }
    const name = this.#take("name");
    if (!name) throw this.#unexpected("a number, a channel, a function or \"(\"");
    return Object.hasOwn(functions, name.text) ? this.#call(name) : symbol(name);
  }

  #call({ text, at }) {
    const [count, of] = functions[text];
    this.#expect("(");
    const inner = [this.#sum()];
    while (this.#take(",")) inner.push(this.#sum());
    this.#expect(")");
    if (inner.length !== count) throw new ExpressionError(`${text} takes ${count} ${count === 1 ? "value" : "values"}, not ${inner.length}`, at);
    const [a, b] = inner;
    return count === 1 ? (values) => of(a(values)) : (values) => of(a(values), b(values));
  }
}

function symbol({ text, at }) {
  const name = text === "μ" ? "mu" : text;
  if (Object.hasOwn(constants, name)) {
    const value = constants[name];
    return () => value;
  }
  const index = symbols.indexOf(name);
  if (index < 0) throw new ExpressionError(`unknown symbol ${text}; expected one of ${symbols.join(", ")}, pi`, at);
  return (values) => values[index];
}

// A function of the values of all symbols; null for a blank text. Throws an ExpressionError.
export function compile(text) {
  if (text.trim() === "") return null;
  if (text.length > longest) throw new ExpressionError(`longer than ${longest} characters`, longest);
  return new Parser(text).whole();
}
