// SPDX-License-Identifier: Apache-2.0
// Lines and dots of many points on a canvas: WebGL2 if available, else the 2-D canvas.
// Points are x, y pairs in CSS pixels in a Float32Array; a point with x = gap ends a line.

export const gap = -1e9;

const lineShader = `#version 300 es
layout(location = 0) in vec2 from;
layout(location = 1) in vec2 to;
uniform vec2 size;
uniform float half_width;
uniform float fade;
uniform float count;
out float across;
out float strength;
void main() {
  if (from.x < -1e8 || to.x < -1e8) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); across = 0.0; strength = 0.0; return; }
  vec2 along = to - from;
  float length_px = length(along);
  along = length_px > 1e-6 ? along / length_px : vec2(1.0, 0.0);
  float reach = half_width + 0.75;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  vec2 end = (gl_VertexID & 2) == 0 ? from - along * half_width * 0.5 : to + along * half_width * 0.5;
  vec2 place = end + vec2(-along.y, along.x) * side * reach;
  across = side * reach;
  strength = mix(fade, 1.0, float(gl_InstanceID) / count);
  gl_Position = vec4(place / size * vec2(2.0, -2.0) + vec2(-1.0, 1.0), 0.0, 1.0);
}`;

const dotShader = `#version 300 es
layout(location = 0) in vec2 from;
uniform vec2 size;
uniform float half_width;
uniform float fade;
uniform float count;
out vec2 corner;
out float strength;
void main() {
  if (from.x < -1e8) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  corner = vec2((gl_VertexID & 1) == 0 ? -1.0 : 1.0, (gl_VertexID & 2) == 0 ? -1.0 : 1.0) * (half_width + 0.75);
  strength = mix(fade, 1.0, float(gl_InstanceID) / count);
  gl_Position = vec4((from + corner) / size * vec2(2.0, -2.0) + vec2(-1.0, 1.0), 0.0, 1.0);
}`;

const lineColour = `#version 300 es
precision highp float;
in float across;
in float strength;
uniform vec4 colour;
uniform float half_width;
out vec4 result;
void main() {
  float cover = clamp(half_width + 0.5 - abs(across), 0.0, 1.0);
  result = colour * cover * strength;
}`;

const dotColour = `#version 300 es
precision highp float;
in vec2 corner;
in float strength;
uniform vec4 colour;
uniform float half_width;
out vec4 result;
void main() {
  float cover = clamp(half_width + 0.5 - length(corner), 0.0, 1.0);
  result = colour * cover * strength;
}`;

let wanted = null;

// WebGL is used on a graphics processor, unless ?webgl=1 or ?webgl=0 decides: emulated in software it is
// much slower than the 2-D canvas.
function wantsWebGl() {
  const query = new URLSearchParams(window.location.search).get("webgl");
  wanted ??= query === null ? hasGraphicsProcessor() : query !== "0";
  return wanted;
}

function hasGraphicsProcessor() {
  const gl = document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  const named = gl.getExtension("WEBGL_debug_renderer_info");
  const renderer = String(gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}

export class TraceCanvas {
  #gl = null;
  #flat = null;
  #programs = null;
  #buffer = null;
  #bytes = 0;
  #colours = new Map();

  constructor(canvas) {
    this.canvas = canvas;
    this.width = 0;
    this.height = 0;
    this.ratio = 1;
    if (wantsWebGl()) {
      this.#gl = canvas.getContext("webgl2", { antialias: false, depth: false, stencil: false, premultipliedAlpha: true });
    }
    if (this.#gl) {
      this.#prepare();
      canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.#programs = null; });
      canvas.addEventListener("webglcontextrestored", () => this.#prepare());
    } else {
      this.#flat = canvas.getContext("2d");
    }
  }

  get kind() { return this.#gl ? "webgl2" : "canvas2d"; }

  #prepare() {
    const gl = this.#gl;
    this.#bytes = 0;
    this.#buffer = gl.createBuffer();
    this.#programs = { line: this.#program(lineShader, lineColour), dot: this.#program(dotShader, dotColour) };
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  #program(vertex, fragment) {
    const gl = this.#gl;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`WebGL shader: ${gl.getProgramInfoLog(program)}`);
    }
    const at = (name) => gl.getUniformLocation(program, name);
    return { program, size: at("size"), halfWidth: at("half_width"), colour: at("colour"), fade: at("fade"), count: at("count") };
  }

  // Size in CSS pixels.
  resize(width, height, ratio) {
    const across = Math.max(1, Math.round(width * ratio));
    const down = Math.max(1, Math.round(height * ratio));
    if (this.canvas.width !== across) this.canvas.width = across;
    if (this.canvas.height !== down) this.canvas.height = down;
    this.width = across / ratio;
    this.height = down / ratio;
    this.ratio = ratio;
  }

  // Clears the canvas.
  begin() {
    const gl = this.#gl;
    if (gl) {
      gl.disable(gl.SCISSOR_TEST);
      gl.viewport(0, 0, this.canvas.width, this.canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
    } else {
      this.#flat.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
      this.#flat.clearRect(0, 0, this.width, this.height);
    }
  }

  // Clips the following drawing to this rectangle.
  clip(x, y, width, height) {
    const gl = this.#gl;
    if (gl) {
      const r = this.ratio;
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(Math.round(x * r), Math.round(this.canvas.height - (y + height) * r), Math.round(width * r), Math.round(height * r));
    } else {
      this.#flat.save();
      this.#flat.beginPath();
      this.#flat.rect(x, y, width, height);
      this.#flat.clip();
    }
  }

  unclip() {
    if (!this.#gl) this.#flat.restore();
  }

  // A line through `count` points; `fade` is the opacity of its oldest part.
  line(points, count, colour, width, fade = 1) {
    if (count < 2) return;
    if (this.#gl) this.#drawGl("line", points, count, count - 1, colour, width, fade);
    else this.#lineFlat(points, count, colour, width, fade);
  }

  dots(points, count, colour, diameter, fade = 1) {
    if (count < 1) return;
    if (this.#gl) this.#drawGl("dot", points, count, count, colour, diameter, fade);
    else this.#dotsFlat(points, count, colour, diameter);
  }

  #drawGl(kind, points, count, instances, colour, width, fade) {
    const gl = this.#gl;
    if (!this.#programs) return; // the context is lost
    const program = this.#programs[kind];
    gl.useProgram(program.program);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffer);
    if (this.#bytes < points.byteLength) {
      gl.bufferData(gl.ARRAY_BUFFER, points.byteLength, gl.STREAM_DRAW);
      this.#bytes = points.byteLength;
    }
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, points, 0, count * 2);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 8, 0);
    gl.vertexAttribDivisor(0, 1);
    if (kind === "line") {
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 2, gl.FLOAT, false, 8, 8);
      gl.vertexAttribDivisor(1, 1);
    } else {
      gl.disableVertexAttribArray(1);
    }
    const [red, green, blue] = this.#parse(colour);
    gl.uniform2f(program.size, this.width, this.height);
    gl.uniform1f(program.halfWidth, width / 2);
    gl.uniform1f(program.fade, fade);
    gl.uniform1f(program.count, Math.max(1, instances));
    gl.uniform4f(program.colour, red, green, blue, 1);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, instances);
  }

  #parse(colour) {
    let parts = this.#colours.get(colour);
    if (!parts) {
      const value = parseInt(colour.slice(1), 16);
      parts = [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
      this.#colours.set(colour, parts);
    }
    return parts;
  }

  #lineFlat(points, count, colour, width, fade) {
    const flat = this.#flat;
    flat.strokeStyle = colour;
    flat.lineWidth = width;
    flat.lineJoin = "bevel";
    const pieces = fade < 1 ? 4 : 1;
    for (let piece = 0; piece < pieces; ++piece) {
      const from = Math.floor((count * piece) / pieces);
      const to = Math.min(count, Math.floor((count * (piece + 1)) / pieces) + 1);
      flat.globalAlpha = pieces === 1 ? 1 : fade + ((1 - fade) * (piece + 1)) / pieces;
      flat.beginPath();
      let open = false;
      for (let i = from; i < to; ++i) {
        const x = points[2 * i];
        if (x < -1e8) open = false;
        else if (open) flat.lineTo(x, points[2 * i + 1]);
        else { flat.moveTo(x, points[2 * i + 1]); open = true; }
      }
      flat.stroke();
    }
    flat.globalAlpha = 1;
  }

  #dotsFlat(points, count, colour, diameter) {
    const flat = this.#flat;
    flat.fillStyle = colour;
    for (let i = 0; i < count; ++i) {
      if (points[2 * i] > -1e8) flat.fillRect(points[2 * i] - diameter / 2, points[2 * i + 1] - diameter / 2, diameter, diameter);
    }
  }

  // Number of non-empty pixels; valid only in the frame that drew them.
  inkedPixels() {
    const { width, height } = this.canvas;
    let data;
    if (this.#gl) {
      data = new Uint8Array(width * height * 4);
      this.#gl.readPixels(0, 0, width, height, this.#gl.RGBA, this.#gl.UNSIGNED_BYTE, data);
    } else {
      data = this.#flat.getImageData(0, 0, width, height).data;
    }
    let inked = 0;
    for (let i = 3; i < data.length; i += 4) if (data[i] > 8) inked += 1;
    return inked;
  }
}
