"use strict";
// The light field on the graphics card. Everything is in index space: lens k across and l down, pixel u across and
// v down under a lens. A point shown by pixel (u, v) under lens (k, l) is shown by pixel (u + 1, v) under lens k + focus.

const SHARED = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
uniform sampler2DArray original, decoded;
uniform ivec2 lenses, ei;
uniform int side, across;   // pages of the mosaic of sub-images: pixels of a side, pages in a row
uniform vec2 corner;        // top left corner of the pane, in pixels from the lower left of the canvas
uniform vec2 origin, pace;  // lens coordinates of that corner, and lenses per pixel
uniform vec2 base, slope;   // a viewer sees pixel base + slope · lens under a lens: (4.1)
uniform vec2 focus;
out vec4 colour;

vec2 place() { return origin + pace * vec2(gl_FragCoord.x - corner.x, corner.y - gl_FragCoord.y); }

vec4 texel(sampler2DArray pages, ivec2 lens, ivec2 view) {
  ivec2 at = view * lenses + clamp(lens, ivec2(0), lenses - 1);
  ivec2 page = at / side;
  return texelFetch(pages, ivec3(at - page * side, page.y * across + page.x), 0);
}

bool beyond(vec2 lens) { return any(lessThan(lens, vec2(-0.5))) || any(greaterThan(lens, vec2(lenses) - 0.5)); }

// Interpolates one pixel between four lenses; 0 outside the array and in pages that have not been loaded.
vec4 between(sampler2DArray pages, vec2 lens, ivec2 view) {
  if (beyond(lens)) return vec4(0);
  ivec2 low = ivec2(floor(lens));
  vec2 t = lens - vec2(low);
  return mix(mix(texel(pages, low, view), texel(pages, low + ivec2(1, 0), view), t.x),
             mix(texel(pages, low + ivec2(0, 1), view), texel(pages, low + ivec2(1, 1), view), t.x), t.y);
}
`;

const VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1), 0, 1); }`;

const VIEW = `${SHARED}
uniform sampler2D preview;
uniform vec2 radius;        // radius of the aperture, in pixels under a lens; 1 interpolates linearly between neighbours
uniform int stride;         // stride of the pixels summed; above 1 for speed while the view moves
uniform int mode;           // 0 original, 1 decoded, 2 split, 3 difference
uniform float divide, gain; // column of the split in pixels; gain of the difference
uniform vec3 mask;

const vec4 NOTHING = vec4(0.05, 0.05, 0.06, 1);

// The scene focused on one plane: the mean of all pixels within the aperture, each from the lens that sees the same
// point. Towards the border of the array the focus falls to 0, so that no lens beyond it is needed.
vec4 look(sampler2DArray pages, vec2 lens) {
  vec2 pixel = base + slope * lens;
  vec2 zone = floor((pixel + 0.5) / vec2(ei));  // 0, or a neighbouring elementary image: a side viewing zone
  pixel = clamp(pixel - zone * vec2(ei), vec2(0), vec2(ei - 1));
  ivec2 first = max(ivec2(0), ivec2(ceil(pixel - radius))), last = min(ei - 1, ivec2(floor(pixel + radius)));
  vec2 at = lens + zone, room = max(min(at + 0.5, vec2(lenses) - 0.5 - at), vec2(0));
  vec2 held = clamp(focus, -room, room);
  vec4 sum = vec4(0);
  for (int v = first.y; v <= last.y; v += stride) {
    for (int u = first.x; u <= last.x; u += stride) {
      vec2 off = vec2(u, v) - pixel;
      vec2 weight = max(vec2(0), 1.0 - abs(off) / radius);
      if (weight.x * weight.y > 0.0)
        sum += weight.x * weight.y * between(pages, at + held * off, ivec2(u, v));
    }
  }
  if (sum.a > 0.0) return vec4(sum.rgb / sum.a, 1);
  if (beyond(at)) return NOTHING;
  return texture(preview, (at + 0.5) / vec2(lenses));
}

void main() {
  vec2 lens = place();
  float x = gl_FragCoord.x - corner.x;
  if (beyond(lens)) {  // there is no picture outside the array, at any focus
    colour = vec4(mask * NOTHING.rgb, 1);
    return;
  }
  if (mode == 3) {
    vec3 apart = look(decoded, lens).rgb - look(original, lens).rgb;
    colour = vec4(mask * (0.5 + gain * apart), 1);
    return;
  }
  bool second = mode == 1 || (mode == 2 && x > divide);
  if (second) colour = look(decoded, lens); else colour = look(original, lens);
  if (mode == 2 && abs(x - divide) < 1.0) colour = vec4(1, 0.8, 0.2, 1);
  colour = vec4(mask * colour.rgb, 1);
}`;

// Epipolar image of one row of lenses: a point is a straight line, which is steeper nearer to the lens plane.
const EPI = `${SHARED}
uniform vec2 cursor;
uniform float rows;         // height of the pane in pixels
uniform int second;
void main() {
  vec2 at = place();
  float pixel = (corner.y - gl_FragCoord.y) / rows * float(ei.x) - 0.5;
  int u = clamp(int(floor(pixel + 0.5)), 0, ei.x - 1);
  int v = clamp(int(floor(base.y + slope.y * cursor.y + 0.5)), 0, ei.y - 1);
  vec2 lens = vec2(at.x, floor(cursor.y + 0.5));
  if (second == 1) colour = between(decoded, lens, ivec2(u, v)); else colour = between(original, lens, ivec2(u, v));
  vec2 seen = vec2(base.x + slope.x * at.x, abs(slope.x * pace.x) + float(ei.x) / rows);
  if (abs(pixel - seen.x) < seen.y) colour.rgb = mix(colour.rgb, vec3(1, 0.8, 0.2), 0.7);
  // the line of a point in focus under the cursor
  float line = (at.x - cursor.x - focus.x * (pixel - base.x - slope.x * cursor.x)) / pace.x;
  float lean = focus.x / pace.x * float(ei.x) / rows;
  if (abs(line) < sqrt(1.0 + lean * lean)) colour.rgb = mix(colour.rgb, vec3(0.3, 0.9, 1), 0.8);
  colour.a = 1.0;
}`;

// The lenslet picture around the cursor; the pixels of the present view are marked.
const RAW = `${SHARED}
uniform vec2 middle;        // centre of the pane, in pixels of the picture
uniform vec2 extent;        // size of the pane
uniform float magnify;
uniform int second;
void main() {
  vec2 in_pane = vec2(gl_FragCoord.x - corner.x, corner.y - gl_FragCoord.y);
  vec2 pixel = middle + (in_pane - extent / 2.0) / magnify;
  ivec2 at = ivec2(floor(pixel));
  if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, lenses * ei))) { colour = vec4(0.05, 0.05, 0.06, 1); return; }
  ivec2 lens = at / ei, view = at - lens * ei;
  if (second == 1) colour = texel(decoded, lens, view); else colour = texel(original, lens, view);
  vec2 seen = floor(base + slope * vec2(lens) + 0.5);
  seen -= floor(seen / vec2(ei)) * vec2(ei);
  vec2 in_pixel = abs(fract(pixel) - 0.5), in_ei = vec2(view) + fract(pixel);
  if (seen == vec2(view) && max(in_pixel.x, in_pixel.y) > 0.5 - max(0.25, 1.0 / magnify))
    colour.rgb = vec3(1, 0.8, 0.2);
  else if (any(lessThan(min(in_ei, vec2(ei) - in_ei), vec2(0.5 / magnify)))) colour.rgb *= 0.6;
  colour.a = 1.0;
}`;

// Variance of the pixels of one point, one focus per pixel: least at the depth of the point.
const PICK = `${SHARED}
uniform vec2 cursor, range;
uniform float count;
void main() {
  vec2 shift = vec2(1, focus.y) * mix(range.x, range.y, (gl_FragCoord.x - 0.5) / (count - 1.0));
  vec2 pixel = clamp(base + slope * cursor, vec2(0), vec2(ei - 1));
  float total = 0.0, samples = 0.0;
  for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
    vec3 sum = vec3(0), square = vec3(0);
    float n = 0.0;
    for (int j = 0; j < 5; j++) for (int i = 0; i < 5; i++) {
      ivec2 view = ivec2(round(vec2(i, j) / 4.0 * vec2(ei - 1)));
      vec4 c = between(original, cursor + vec2(x, y) + shift * (vec2(view) - pixel), view);
      if (c.a > 0.0) { sum += c.rgb; square += c.rgb * c.rgb; n += 1.0; }
    }
    if (n >= 6.0) { total += dot(square / n - sum * sum / (n * n), vec3(1)); samples += 1.0; }
  }
  float value = samples >= 5.0 ? clamp(sqrt(max(total / samples, 0.0)), 0.0, 0.9999) : 0.9999;
  float scaled = value * 255.0;
  colour = vec4(floor(scaled) / 255.0, fract(scaled), 0, 1);
}`;

class LightField {
  constructor(canvas, meta) {
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: false });
    if (!gl) throw new Error("This browser offers no WebGL2, which the viewer needs.");
    // A slot holds one frame, with one texture per picture. Views show the frame in the slot `shown`.
    Object.assign(this, { gl, canvas, meta, programs: {}, slots: [], shown: 0 });
    this.slot(0);
    this.preview = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.preview);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([30, 30, 34, 255]));
    this.smooth();
    for (const [name, source] of Object.entries({ view: VIEW, epi: EPI, raw: RAW, pick: PICK }))
      this.programs[name] = this.program(name, source);
    gl.bindVertexArray(gl.createVertexArray());
  }

  slot(number) {
    return (this.slots[number] ??= this.meta.compared ? [this.array(), this.array()] : [this.array()]);
  }

  array() {
    const { gl, meta } = this, texture = gl.createTexture();
    if (meta.pages > gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS))
      throw new Error(`The picture needs ${meta.pages} texture layers, this browser offers ${gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS)}.`);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA8, meta.side, meta.side, meta.pages);
    for (const what of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, what, gl.NEAREST);
    return texture;
  }

  smooth() {
    const { gl } = this;
    for (const what of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, what, gl.LINEAR);
    for (const what of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, what, gl.CLAMP_TO_EDGE);
  }

  program(name, fragment) {
    const { gl } = this, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`${name}: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`${name}: ${gl.getProgramInfoLog(program)}`);
    const places = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name: uniform, type } = gl.getActiveUniform(program, i);
      places[uniform] = [gl.getUniformLocation(program, uniform), type];
    }
    return { program, places };
  }

  async put(bytes, target) {
    // decode off the main thread, without changing code values
    const bitmap = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    target(bitmap);
    bitmap.close();
  }

  setPreview(bytes) {
    const { gl } = this;
    return this.put(bytes, (bitmap) => {
      gl.bindTexture(gl.TEXTURE_2D, this.preview);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    });
  }

  setPage(slot, picture, layer, bytes) {
    const { gl } = this;
    return this.put(bytes, (bitmap) => {
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.slot(slot)[picture]);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, bitmap.width, bitmap.height, 1, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    });
  }

  // Clips the drawing of `render` at the edges of a pane.
  within(pane, render) {
    const { gl } = this;
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(pane.x, pane.y, pane.width, pane.height);
    render();
    gl.disable(gl.SCISSOR_TEST);
  }

  // Draws one pane: {x, y, width, height} in canvas pixels from its lower left corner.
  draw(name, pane, values) {
    const { gl, meta } = this, { program, places } = this.programs[name];
    if (!(pane.width > 0 && pane.height > 0)) return;
    gl.viewport(pane.x, pane.y, pane.width, pane.height);
    gl.useProgram(program);
    const [original, decoded = original] = this.slot(this.shown);
    const textures = [["original", gl.TEXTURE_2D_ARRAY, original],
      ["decoded", gl.TEXTURE_2D_ARRAY, decoded], ["preview", gl.TEXTURE_2D, this.preview]];
    textures.forEach(([uniform, kind, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(kind, texture);
      if (places[uniform]) gl.uniform1i(places[uniform][0], unit);
    });
    const all = { lenses: meta.lenses, ei: meta.ei, side: meta.side, across: meta.across,
      corner: [pane.x, pane.y + pane.height], ...values };
    for (const [uniform, value] of Object.entries(all)) if (places[uniform]) this.set(places[uniform], value);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  set([place, type], value) {
    const { gl } = this;
    if (type === gl.INT) gl.uniform1i(place, value);
    else if (type === gl.INT_VEC2) gl.uniform2iv(place, value);
    else if (type === gl.FLOAT) gl.uniform1f(place, value);
    else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, value);
    else gl.uniform3fv(place, value);
  }

  // Renders into a buffer of its own; returns bytes from the top row down.
  offscreen(width, height, render) {
    const { gl } = this, texture = gl.createTexture(), buffer = gl.createFramebuffer();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.disable(gl.SCISSOR_TEST);
    render({ x: 0, y: 0, width, height });
    const bytes = new Uint8ClampedArray(4 * width * height), row = 4 * width;
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(buffer);
    gl.deleteTexture(texture);
    for (let top = 0, low = height - 1; top < low; top++, low--) {
      const kept = bytes.slice(top * row, (top + 1) * row);
      bytes.copyWithin(top * row, low * row, (low + 1) * row);
      bytes.set(kept, low * row);
    }
    return bytes;
  }
}
