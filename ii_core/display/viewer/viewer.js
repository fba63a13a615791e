"use strict";
// What the user sees and does: panes, the viewer's place, pointer, keyboard, and a link that keeps it all.

const DEFAULTS = { x: 0, y: 0, r: 1, f: 0, a: 1, zoom: 1, cx: 0.5, cy: 0.5, mode: "original", split: 0.5, gain: 4,
  stereo: "off", eyes: 0.25 };
// The opening focus moves a neighbouring pixel's lens by at most this share of the array.
const OPENING_SHARE = 1 / 16;
const MODES = ["original", "decoded", "split", "difference"];

class Viewer {
  constructor(meta) {
    this.meta = meta;
    this.canvas = document.getElementById("canvas");
    this.field = new LightField(this.canvas, meta);
    this.limits = { x: [-2, 2], y: [-2, 2], r: [0.35, 10], f: meta.focus, a: [1, Math.max(1, Math.max(...meta.ei) / 2)],
      zoom: [1, 40], cx: [0, 1], cy: [0, 1], split: [0, 1], gain: [1, 32], eyes: [0, 1] };
    // What the page opens with and Reset returns to; the focus comes once the picture is there.
    this.opening = { ...DEFAULTS, ...(meta.compared ? { mode: "split" } : {}) };
    this.state = { ...this.opening };
    this.cursor = [(meta.lenses[0] - 1) / 2, (meta.lenses[1] - 1) / 2];
    this.quick = false;
    this.work = [];
    this.fromLink();
    this.bind();
    this.canvas.addEventListener("webglcontextlost", () =>
      ii.failed("The graphics card gave the picture up, perhaps for want of memory. Reload the page to try again."));
    new ResizeObserver(() => this.redraw()).observe(document.body);
    this.redraw();
  }

  // --- data, as it comes -------------------------------------------------------------------------------------
  bytes(text) {
    return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  }

  preview(data) {
    this.work.push(this.field.setPreview(data).then(() => this.redraw()));
  }

  page(picture, layer, data) {
    this.work.push(this.field.setPage(picture, layer, data).then(() => {
      const all = this.meta.pages * (this.meta.compared ? 2 : 1);
      this.say(this.field.loaded < all ? `loading ${this.field.loaded} of ${all}` : "");
      this.redraw();
    }));
  }

  depth(data) {
    this.depthMap = new Float32Array(data.buffer, data.byteOffset, data.byteLength / 4);
  }

  async finished() {
    await Promise.all(this.work);
    this.say("");
    this.opening.f = this.start();
    if (!/[#&]f=/.test(location.hash)) this.state.f = this.opening.f;
    this.redraw();
  }

  // Where the focus is unless the link says it: on the nearer things, or on what lies in the middle, as far as
  // neighbouring pixels' lenses stay in the array almost everywhere.
  start() {
    const found = this.depthMap ? [...this.depthMap].filter(Number.isFinite).sort((a, b) => a - b) : [];
    const f = found.length ? this.focusOf(found[Math.floor(found.length / 4)]) : this.pick(this.cursor);
    const { lenses, camera: c, focus: [near, far] } = this.meta;
    const rows = c.vertical_parallax ? lenses[1] * c.lens_pitch_mm[1] / c.lens_pitch_mm[0] : Infinity;
    const most = OPENING_SHARE * Math.min(lenses[0], rows);
    return Math.min(Math.max(f, near, -most), far, most);
  }

  // --- geometry ----------------------------------------------------------------------------------------------
  viewpoint(eye = 0) {
    const { gap_mm: gap, distance_mm, phi, theta } = this.meta.camera, { x, y, r } = this.state;
    const sx = Math.sin((x + eye) * phi), sy = Math.sin(y * theta);
    return [r * distance_mm * sx, r * distance_mm * sy, gap - r * distance_mm * Math.sqrt(Math.max(0.01, 1 - sx * sx - sy * sy))];
  }

  // (4.1) and (4.2) in index space: pixel = base + slope · lens.
  lines(eye = 0) {
    const { camera: c, ei, sign } = this.meta, e = this.viewpoint(eye);
    const scale = (sign * c.gap_mm) / ((c.gap_mm - e[2]) * c.pixel_pitch_mm), down = scale * (c.vertical_parallax ? 1 : 0);
    return {
      base: [(ei[0] - 1) / 2 - scale * (c.lens_pitch_mm[0] / 2 - c.size_mm[0] / 2 - e[0]),
        (ei[1] - 1) / 2 + down * (c.size_mm[1] / 2 - c.lens_pitch_mm[1] / 2 - e[1])],
      slope: [-scale * c.lens_pitch_mm[0], -down * c.lens_pitch_mm[1]],
    };
  }

  shift() {
    const { sign, camera: c } = this.meta;
    return [sign * this.state.f, c.vertical_parallax ? sign * this.state.f * c.lens_pitch_mm[0] / c.lens_pitch_mm[1] : 0];
  }

  depthOf(f) {
    const c = this.meta.camera;
    return c.gap_mm * (1 + f * c.lens_pitch_mm[0] / c.pixel_pitch_mm);
  }

  focusOf(depth) {
    const c = this.meta.camera;
    return (depth / c.gap_mm - 1) * c.pixel_pitch_mm / c.lens_pitch_mm[0];
  }

  optics(eye = 0) {
    const ei = this.meta.ei;
    return { ...this.lines(eye), focus: this.shift(), radius: ei.map((n) => Math.min(this.state.a, Math.max(1, n / 2))) };
  }

  // Lens coordinates of a pane: the whole array fits at zoom 1; `cx`, `cy` is the array's point in the middle.
  map(pane) {
    const { lenses, camera: c } = this.meta, size = lenses.map((n, i) => n * c.lens_pitch_mm[i]);
    const scale = Math.min(pane.width / size[0], pane.height / size[1]) * this.state.zoom;
    const pace = c.lens_pitch_mm.map((pitch) => 1 / (scale * pitch));
    const middle = [this.state.cx * lenses[0] - 0.5, this.state.cy * lenses[1] - 0.5];
    return { origin: [middle[0] - (pane.width / 2) * pace[0], middle[1] - (pane.height / 2) * pace[1]], pace };
  }

  pane(id) {
    const box = document.getElementById(id).getBoundingClientRect(), all = this.canvas.getBoundingClientRect(), d = this.density;
    const round = (v) => Math.round(v * d);
    return { x: round(box.left - all.left), y: this.canvas.height - round(box.bottom - all.top),
      width: round(box.width), height: round(box.height) };
  }

  // --- drawing -----------------------------------------------------------------------------------------------
  redraw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.paint();
    });
  }

  paint() {
    const { canvas } = this, { gl } = this.field;
    this.density = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * this.density), height = Math.round(canvas.clientHeight * this.density);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.clearColor(0.07, 0.07, 0.08, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.paintViews(this.pane("main"));
    const second = this.state.mode === "decoded" ? 1 : 0, cursor = this.cursor;
    const epi = this.pane("epi"), raw = this.pane("raw"), { origin, pace } = this.map(this.pane("main"));
    this.field.draw("epi", epi, { ...this.optics(), origin: [origin[0], 0], pace: [pace[0], 0], cursor, rows: epi.height, second });
    const ei = this.meta.ei, middle = cursor.map((n, i) => (Math.round(n) + 0.5) * ei[i]);
    this.field.draw("raw", raw, { ...this.optics(), middle, extent: [raw.width, raw.height],
      magnify: Math.max(2, raw.width / (5 * Math.max(...ei))), second });
    this.showState();
  }

  paintViews(pane) {
    const { state, meta } = this, half = Math.floor(pane.width / 2), gl = this.field.gl;
    const mode = meta.compared ? MODES.indexOf(state.mode) : 0;
    const one = (where, eye, mask) => this.field.draw("view", where, { ...this.optics(eye), ...this.map(where), mask, mode,
      divide: state.split * where.width, gain: state.gain, stride: this.stride() });
    if (state.stereo === "cross-eyed") {
      one({ ...pane, width: half }, state.eyes, [1, 1, 1]);
      one({ ...pane, x: pane.x + half, width: pane.width - half }, -state.eyes, [1, 1, 1]);
    } else if (state.stereo === "anaglyph") {
      one(pane, -state.eyes, [1, 0, 0]);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE);
      one(pane, state.eyes, [0, 1, 1]);
      gl.disable(gl.BLEND);
    } else one(pane, 0, [1, 1, 1]);
  }

  // While something moves, at most about 8 × 8 pixels under each lens are added up.
  stride() {
    return this.quick ? Math.max(1, Math.round(this.state.a / 4)) : 1;
  }

  // The present view with one pixel a lens, as `view_image` makes it: {width, height, data}.
  snapshot() {
    const [width, height] = this.meta.lenses;
    const data = this.field.offscreen(width, height, (pane) => this.field.draw("view", pane, { ...this.optics(),
      origin: [-0.5, -0.5], pace: [1, 1], mask: [1, 1, 1], mode: this.meta.compared ? MODES.indexOf(this.state.mode) : 0,
      divide: this.state.split * width, gain: this.state.gain, stride: 1 }));
    return { width, height, data };
  }

  async save() {
    const { width, height, data } = this.snapshot(), canvas = document.createElement("canvas");
    Object.assign(canvas, { width, height });
    canvas.getContext("2d").putImageData(new ImageData(data, width, height), 0, 0);
    const link = document.createElement("a");
    link.href = canvas.toDataURL("image/png");
    link.download = `${this.meta.name}_view.png`;
    link.click();
  }

  // --- focus -------------------------------------------------------------------------------------------------
  // The focus at which all pixels that see the point under a place agree best; from the depth map if there is one.
  pick(lens) {
    if (this.depthMap) return this.pickFromMap(lens);
    const count = 512, { base, slope } = this.lines(), range = this.meta.focus.map((f) => f * this.meta.sign);
    const ratio = this.meta.camera.vertical_parallax ? this.meta.camera.lens_pitch_mm[0] / this.meta.camera.lens_pitch_mm[1] : 0;
    const bytes = this.field.offscreen(count, 1, (pane) =>
      this.field.draw("pick", pane, { base, slope, focus: [1, ratio], cursor: lens, range, count }));
    let best = 0, least = Infinity;
    for (let i = 0; i < count; i++) {
      const value = bytes[4 * i] + bytes[4 * i + 1] / 255;
      if (value < least) [least, best] = [value, i];
    }
    return this.meta.focus[0] + (this.meta.focus[1] - this.meta.focus[0]) * best / (count - 1);
  }

  // Walk along the line of sight until it passes the surface that the centre view's depth map tells.
  pickFromMap(lens) {
    const { lenses, ei, sign, camera: c } = this.meta, { base, slope } = this.lines();
    const ratio = c.vertical_parallax ? c.lens_pitch_mm[0] / c.lens_pitch_mm[1] : 0, [near, far] = this.meta.focus;
    const centre = ei.map((n) => Math.floor(n / 2)), steps = 2000;  // as `depth_view` takes it
    let nearest = null, apart = Infinity;
    for (let i = 0; i <= steps; i++) {
      const f = near + (far - near) * i / steps;
      const at = lens.map((n, axis) => Math.round(n + sign * f * (axis ? ratio : 1) * (centre[axis] - base[axis] - slope[axis] * n)));
      if (at.some((n, axis) => n < 0 || n >= lenses[axis])) continue;
      const surface = this.focusOf(this.depthMap[at[1] * lenses[0] + at[0]]);
      if (!Number.isFinite(surface)) continue;
      if (surface <= f) return surface;
      if (surface - f < apart) [apart, nearest] = [surface - f, surface];
    }
    return nearest ?? this.state.f;
  }

  // --- state -------------------------------------------------------------------------------------------------
  set(change, quick = false) {
    for (const [key, value] of Object.entries(change)) {
      const limit = this.limits[key];
      this.state[key] = limit ? Math.min(Math.max(Number(value), limit[0]), limit[1]) : value;
    }
    if (quick) {
      this.quick = true;
      clearTimeout(this.rest);
      this.rest = setTimeout(() => {
        this.quick = false;
        this.toLink();
        this.redraw();
      }, 200);
    } else this.toLink();
    this.redraw();
  }

  toLink() {
    const kept = Object.entries(this.state).filter(([key, value]) => value !== this.opening[key]);
    const text = kept.map(([key, value]) => `${key}=${typeof value === "number" ? +value.toFixed(5) : value}`).join("&");
    history.replaceState(null, "", text ? `#${text}` : location.pathname + location.search);
  }

  fromLink() {
    for (const [key, value] of new URLSearchParams(location.hash.slice(1))) {
      if (key === "mode" && (!MODES.includes(value) || !this.meta.compared)) continue;
      if (key === "stereo" && !["off", "cross-eyed", "anaglyph"].includes(value)) continue;
      if (key in this.limits && Number.isFinite(Number(value)))
        this.state[key] = Math.min(Math.max(Number(value), this.limits[key][0]), this.limits[key][1]);
      else if (key === "mode" || key === "stereo") this.state[key] = value;
    }
  }

  say(text) {
    document.getElementById("status").textContent = text;
  }

  showState() {
    const { state, meta } = this;
    for (const input of document.querySelectorAll("[data-state]"))
      if (document.activeElement !== input || input.type === "range") input.value = state[input.dataset.state];
    const degrees = (angle) => (angle * 180 / Math.PI).toFixed(1);
    const outside = Math.abs(state.x) > 1 || Math.abs(state.y) > 1;
    const texts = {
      place: `${degrees(state.x * meta.camera.phi)}°, ${degrees(state.y * meta.camera.theta)}°${outside ? " – outside the zone" : ""}`,
      focus: meta.camera.assumed ? `${state.f.toFixed(2)} lenses a pixel` : `z = ${this.depthOf(state.f).toFixed(2)} mm`,
      aperture: `${(2 * state.a - 1).toFixed(1)} px`,
    };
    for (const [id, text] of Object.entries(texts)) document.getElementById(id).textContent = text;
  }

  // --- input -------------------------------------------------------------------------------------------------
  bind() {
    const main = document.getElementById("main");
    const pointers = new Map();
    let moved = 0, grip = null;
    main.addEventListener("pointerdown", (event) => {
      main.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      moved = 0;
      const box = main.getBoundingClientRect(), x = (event.clientX - box.left) / box.width;
      grip = this.state.mode === "split" && Math.abs(x - this.state.split) * box.width < 12 ? "split" : event.shiftKey ? "pan" : "look";
    });
    main.addEventListener("pointermove", (event) => {
      this.point(event);
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY], box = main.getBoundingClientRect();
      const delta = [now[0] - before[0], now[1] - before[1]];
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
        const length = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
        this.set({ zoom: this.state.zoom * length(now) / Math.max(1, length(before)) }, true);
      } else if (grip === "split") this.set({ split: (now[0] - box.left) / box.width }, true);
      else if (grip === "pan") this.pan(-delta[0], -delta[1]);
      else this.look(-delta[0] / box.width, delta[1] / box.height);
      moved += Math.abs(delta[0]) + Math.abs(delta[1]);
      pointers.set(event.pointerId, now);
    });
    const up = (event) => {
      if (pointers.delete(event.pointerId) && moved < 4 && event.type === "pointerup" && grip === "look") {
        this.point(event);
        this.set({ f: this.pick(this.cursor) });
      }
    };
    main.addEventListener("pointerup", up);
    main.addEventListener("pointercancel", up);
    main.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.set({ zoom: this.state.zoom * Math.exp(-event.deltaY / 400) }, true);
    }, { passive: false });
    main.addEventListener("keydown", (event) => this.key(event));
    for (const input of document.querySelectorAll("[data-state]")) {
      const limit = this.limits[input.dataset.state];
      if (input.type === "range") Object.assign(input, { min: limit[0], max: limit[1], step: (limit[1] - limit[0]) / 1000 });
      input.addEventListener("input", () => this.set({ [input.dataset.state]: input.value }, input.type === "range"));
    }
    document.getElementById("save").addEventListener("click", () => this.save());
    document.getElementById("reset").addEventListener("click", () => this.set({ ...this.opening }));
    window.addEventListener("hashchange", () => {
      this.state = { ...this.opening };
      this.fromLink();
      this.redraw();
    });
  }

  // Dragging turns the scene: to the right, and the viewer goes left. A pane's width is the whole viewing zone.
  look(across, up) {
    this.set({ x: this.state.x + 2 * across, y: this.state.y + 2 * up }, true);
  }

  pan(dx, dy) {
    const { pace } = this.map(this.pane("main")), d = this.density, { lenses } = this.meta;
    this.set({ cx: this.state.cx + dx * d * pace[0] / lenses[0], cy: this.state.cy + dy * d * pace[1] / lenses[1] }, true);
  }

  // The lens under the pointer.
  point(event) {
    const box = document.getElementById("main").getBoundingClientRect(), d = this.density, pane = this.pane("main");
    let x = (event.clientX - box.left) * d, where = pane;
    if (this.state.stereo === "cross-eyed") {
      where = { ...pane, width: Math.floor(pane.width / 2) };
      x %= where.width;
    }
    const { origin, pace } = this.map(where);
    const lens = [origin[0] + pace[0] * x, origin[1] + pace[1] * (event.clientY - box.top) * d];
    this.cursor = lens.map((n, axis) => Math.min(Math.max(n, 0), this.meta.lenses[axis] - 1));
    this.redraw();
  }

  key(event) {
    const { state } = this, step = event.shiftKey ? 0.25 : 0.05, [near, far] = this.meta.focus;
    const moves = {
      ArrowLeft: () => ({ x: state.x - step }), ArrowRight: () => ({ x: state.x + step }),
      ArrowUp: () => ({ y: state.y + step }), ArrowDown: () => ({ y: state.y - step }),
      "+": () => ({ zoom: state.zoom * 1.2 }), "=": () => ({ zoom: state.zoom * 1.2 }), "-": () => ({ zoom: state.zoom / 1.2 }),
      "[": () => ({ f: state.f - (far - near) / 100 }), "]": () => ({ f: state.f + (far - near) / 100 }),
      ",": () => ({ a: state.a - 0.5 }), ".": () => ({ a: state.a + 0.5 }),
      PageUp: () => ({ r: state.r * 1.1 }), PageDown: () => ({ r: state.r / 1.1 }),
      Enter: () => ({ f: this.pick(this.cursor) }), Home: () => ({ x: 0, y: 0, zoom: 1, cx: 0.5, cy: 0.5 }),
      m: () => (this.meta.compared ? { mode: MODES[(MODES.indexOf(state.mode) + 1) % 4] } : {}),
      s: () => ({ stereo: { off: "cross-eyed", "cross-eyed": "anaglyph", anaglyph: "off" }[state.stereo] }),
    };
    if (!(event.key in moves) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.set(moves[event.key](), true);
  }
}

// Called by the page as its parts arrive; text is base64.
const ii = {
  start(meta) {
    try {
      ii.viewer = new Viewer(meta);
    } catch (error) {
      ii.failed(error.message);
    }
  },
  failed(message) {
    document.getElementById("failure").textContent = message;
    document.getElementById("failure").hidden = false;
  },
  preview: (text) => ii.viewer?.preview(ii.viewer.bytes(text)),
  page: (picture, layer, text) => ii.viewer?.page(picture, layer, ii.viewer.bytes(text)),
  depth: (text) => ii.viewer?.depth(ii.viewer.bytes(text)),
  // The same from files beside the page, for a picture too large to stand in it.
  async fetch(order) {
    const load = async (name) => new Uint8Array(await (await fetch(name)).arrayBuffer());
    if (!ii.viewer) return;
    for (const [kind, name, ...where] of order) {
      const data = await load(name);
      if (kind === "page") ii.viewer.page(...where, data);
      else ii.viewer[kind](data);
    }
    ii.done();
  },
  done: () => (ii.ready = ii.viewer?.finished()),
};
