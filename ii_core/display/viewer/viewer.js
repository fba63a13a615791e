"use strict";
// User interface: panes, the viewer's place, pointer, keyboard, and a link that stores the state.

const DEFAULTS = { t: 0, x: 0, y: 0, r: 1, f: 0, a: 1.5, zoom: 1, cx: 0.5, cy: 0.5, mode: "original", split: 0.5, gain: 4,
  stereo: "off", eyes: 0.25 };
// The opening focus moves a neighbouring pixel's lens by at most this share of the array.
const OPENING_SHARE = 1 / 16;
const MODES = ["original", "decoded", "split", "difference"];
// Until the first input the viewer sways: amplitude in shares of the zone, and period in seconds.
const SWAY = { x: 0.45, y: 0.2, seconds: 7 };
const SLOWEST = 250;  // milliseconds per frame: slower rendering, such as on a CPU, stops the sway
const MOST_ZOOMED = 3;  // on a tall screen the opening zoom fills the pane's height, up to this factor

class Viewer {
  constructor(meta) {
    this.meta = meta;
    this.canvas = document.getElementById("canvas");
    this.field = new LightField(this.canvas, meta);
    this.take = new Take(meta, this.field, () => this.redraw(), (message) => this.say(message));
    this.limits = { t: [0, meta.frames - 1], x: [-2, 2], y: [-2, 2], r: [0.35, 10], f: meta.focus, a: [1, Math.max(1, Math.max(...meta.ei) / 2)],
      zoom: [1, 40], cx: [0, 1], cy: [0, 1], split: [0, 1], gain: [1, 32], eyes: [0, 1] };
    // Initial state, also that of Reset; the focus is set once the picture is loaded.
    this.opening = { ...DEFAULTS, a: Math.min(DEFAULTS.a, this.limits.a[1]), zoom: this.openingZoom(),
      ...(meta.compared ? { mode: "split" } : {}) };
    this.state = { ...this.opening };
    this.swung = [0, 0];
    this.cursor = [(meta.lenses[0] - 1) / 2, (meta.lenses[1] - 1) / 2];
    this.quick = false;
    this.work = [];
    this.loaded = 0;
    this.fromLink();
    this.focused = /[#&]f=/.test(location.hash);  // set by the link or, during loading, by the user
    this.bind();
    this.canvas.addEventListener("webglcontextlost", () =>
      ii.failed("The graphics card has dropped the picture, perhaps because memory ran out. Reload the page to try again."));
    new ResizeObserver(() => this.redraw()).observe(document.getElementById("main"));
    document.querySelector("aside").addEventListener("scroll", () => this.redraw());
    this.redraw();
  }

  // --- loading of data ---------------------------------------------------------------------------------------
  bytes(text) {
    return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  }

  preview(data) {
    this.work.push(this.field.setPreview(data).then(() => this.redraw()));
  }

  page(picture, layer, frame, source) {
    const loading = this.take.add(frame, picture, layer, source)?.then(() => {
      const all = this.meta.pages * (this.meta.compared ? 2 : 1);
      this.loaded += 1;
      this.say(this.loaded < all ? `loading ${this.loaded} of ${all}` : "");
      this.redraw();
    });
    if (loading) this.work.push(loading);
    return loading;
  }

  depth(data) {
    this.depthMap = new Float32Array(data.buffer, data.byteOffset, data.byteLength / 4);
  }

  async finished() {
    await Promise.all(this.work);
    this.say("");
    this.opening.f = this.start();
    if (!this.focused) this.state.f = this.opening.f;
    this.take.ready();
    this.take.seek(this.state.t);
    this.redraw();
    if (!this.touched && !location.hash && !matchMedia("(prefers-reduced-motion: reduce)").matches) this.sway();
  }

  // Sway the viewer around the place in the state, until `set` changes something.
  sway() {
    let begun = null, before = null, slow = 0;
    const step = (now) => {
      begun ??= now;
      slow = before !== null && now - before > SLOWEST ? slow + 1 : 0;
      before = now;
      if (this.touched || slow > 3) {
        this.swaying = false;
        this.swung = [0, 0];
      } else {
        const angle = 2 * Math.PI * (now - begun) / 1000 / SWAY.seconds;
        this.swung = [SWAY.x * Math.sin(angle), SWAY.y * Math.sin(2 * angle)];
        requestAnimationFrame(step);
      }
      this.redraw();
    };
    this.swaying = true;
    requestAnimationFrame(step);
  }

  // Zoom 1 shows the whole array; on a tall screen this would leave most of the pane empty.
  openingZoom() {
    const box = document.getElementById("main").getBoundingClientRect(), { lenses, camera: c } = this.meta;
    const across = box.width / (lenses[0] * c.lens_pitch_mm[0]), down = box.height / (lenses[1] * c.lens_pitch_mm[1]);
    return box.height > box.width ? Math.min(Math.max(1, down / across), MOST_ZOOMED) : 1;
  }

  // Initial focus unless the link sets it: the first quartile of the depth map, or the point in the middle. The focus
  // is limited such that the lenses of neighbouring pixels stay in the array almost everywhere.
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
    const [across, up] = this.swung, sx = Math.sin((x + across + eye) * phi), sy = Math.sin((y + up) * theta);
    return [r * distance_mm * sx, r * distance_mm * sy, gap - r * distance_mm * Math.sqrt(Math.max(0.01, 1 - sx * sx - sy * sy))];
  }

  // (4.1) and (4.2) in index space: pixel = base + slope · lens.
  lines(eye = 0) {
    const { camera: c, ei, sign } = this.meta, e = this.viewpoint(eye);
    const scale = (sign * c.gap_mm) / ((c.gap_mm - e[2]) * c.pixel_pitch_mm), down = scale * (c.vertical_parallax ? 1 : 0);
    // Elementary images are offset from their lenses if viewing zones converge on a viewer.
    const aside = c.viewer_mm ? sign * c.gap_mm / (c.viewer_mm * c.pixel_pitch_mm) : 0;
    const beside = c.vertical_parallax ? aside : 0;
    const first = [c.lens_pitch_mm[0] / 2 - c.size_mm[0] / 2, c.size_mm[1] / 2 - c.lens_pitch_mm[1] / 2];
    return {
      base: [(ei[0] - 1) / 2 - scale * (first[0] - e[0]) + aside * first[0],
        (ei[1] - 1) / 2 + down * (first[1] - e[1]) - beside * first[1]],
      slope: [(aside - scale) * c.lens_pitch_mm[0], (beside - down) * c.lens_pitch_mm[1]],
    };
  }

  shift() {
    const { sign, camera: c } = this.meta;
    return [sign * this.state.f, c.vertical_parallax ? sign * this.state.f * c.lens_pitch_mm[0] / c.lens_pitch_mm[1] : 0];
  }

  // Lenses a pixel by which a plane moves from view to view, per mm beyond the lens plane.
  perMm() {
    const c = this.meta.camera;
    return c.pixel_pitch_mm / (c.gap_mm * c.lens_pitch_mm[0]);
  }

  depthOf(f) {
    const c = this.meta.camera, beyond = f / (this.perMm() - (c.viewer_mm ? f / c.viewer_mm : 0));
    return c.origin_mm + c.gap_mm + beyond;
  }

  focusOf(depth) {
    const c = this.meta.camera, beyond = depth - c.origin_mm - c.gap_mm;
    return this.perMm() * beyond / (1 + (c.viewer_mm ? beyond / c.viewer_mm : 0));
  }

  optics(eye = 0) {
    const ei = this.meta.ei;
    return { ...this.lines(eye), focus: this.shift(), radius: ei.map((n) => Math.min(this.state.a, Math.max(1, n / 2))) };
  }

  // Pixels of the canvas per pixel of the page; known before the first painting, since a click may come earlier.
  get density() {
    return Math.min(window.devicePixelRatio || 1, 2);
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
    const box = document.querySelector(id === "aside" ? id : `#${id}`).getBoundingClientRect(), all = this.canvas.getBoundingClientRect(), d = this.density;
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
    const width = Math.round(canvas.clientWidth * this.density), height = Math.round(canvas.clientHeight * this.density);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.clearColor(0.07, 0.07, 0.08, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.paintViews(this.pane("main"));
    const second = this.state.mode === "decoded" ? 1 : 0, cursor = this.cursor;
    const epi = this.pane("epi"), raw = this.pane("raw"), { origin, pace } = this.map(this.pane("main"));
    this.field.draw("epi", epi, { ...this.optics(), origin: [origin[0], 0], pace: [pace[0], 0], cursor, rows: epi.height, second });
    const ei = this.meta.ei, middle = cursor.map((n, i) => (Math.round(n) + 0.5) * ei[i]);
    this.field.within(this.pane("aside"), () => this.field.draw("raw", raw, { ...this.optics(), middle,
      extent: [raw.width, raw.height], magnify: Math.max(2, raw.width / (5 * Math.max(...ei))), second }));
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

  // During motion, about 8 × 8 pixels under each lens are summed at most.
  stride() {
    return this.quick || this.take.playing ? Math.max(1, Math.round(this.state.a / 4)) : 1;
  }

  // The present view with one pixel per lens, as in `view_image`: {width, height, data}.
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
  // Return the focus of least variance among the pixels that see the point at a place; from the depth map if given.
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

  // Step along the line of sight until it passes the surface of the centre view's depth map.
  pickFromMap(lens) {
    const { lenses, ei, sign, camera: c } = this.meta, { base, slope } = this.lines();
    const ratio = c.vertical_parallax ? c.lens_pitch_mm[0] / c.lens_pitch_mm[1] : 0, [near, far] = this.meta.focus;
    const centre = ei.map((n) => Math.floor(n / 2)), steps = 2000;  // as in `depth_view`
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
    if (this.swaying) {  // continue from the present place of the sway
      this.state.x += this.swung[0];
      this.state.y += this.swung[1];
      this.swung = [0, 0];
    }
    this.touched = true;
    this.focused ||= "f" in change;
    for (const [key, value] of Object.entries(change)) {
      this.state[key] = this.limits[key] ? this.limited(key, value) : value;
    }
    if ("t" in change) this.take.seek(this.state.t);
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

  limited(key, value) {
    const [low, high] = this.limits[key], inside = Math.min(Math.max(Number(value), low), high);
    return key === "t" ? Math.round(inside) : inside;
  }

  // Play or pause. Viewpoint, focus and comparison can be changed during playback.
  play(on) {
    if (on) this.take.play((frame) => {
      this.state.t = frame;
      this.redraw();
    });
    else {
      this.take.pause();
      this.toLink();
    }
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
      if (Object.hasOwn(this.limits, key) && Number.isFinite(Number(value)))
        this.state[key] = this.limited(key, value);
      else if (key === "mode" || key === "stereo") this.state[key] = value;
    }
  }

  say(text) {
    document.getElementById("status").textContent = text;
  }

  // Labels of the values.
  shown() {
    const { state, meta: { camera: c } } = this, degrees = (angle) => `${(angle * 180 / Math.PI).toFixed(1)}°`;
    const long = (mm, digits) => Math.abs(mm) < 1e4 ? `${mm.toFixed(digits)} mm`
      : Math.abs(mm) < 1e6 ? `${(mm / 1e3).toPrecision(4)} m`
      : Math.abs(mm) < 1e9 ? `${(mm / 1e6).toPrecision(4)} km` : "∞";
    const late = !this.take.playing && this.take.shown !== state.t;
    return {
      t: late ? "loading" : `${(state.t / this.meta.fps).toFixed(2)} s`,
      x: degrees(state.x * c.phi), y: degrees(state.y * c.theta),
      r: c.assumed ? `${state.r.toFixed(2)} ×` : long(state.r * c.distance_mm, 0),
      f: c.assumed ? `${state.f.toFixed(2)} lens/px` : `z ${long(this.depthOf(state.f), 1)}`,
      a: `${(2 * state.a - 1).toFixed(1)} px`, zoom: `${state.zoom.toFixed(2)} ×`, eyes: degrees(2 * state.eyes * c.phi),
      split: `${(100 * state.split).toFixed(0)} %`, gain: `${state.gain.toFixed(1)} ×`,
    };
  }

  // Whether a control has an effect in the present state.
  matters(key) {
    const { state, meta: { ei, camera } } = this, limit = this.limits[key];
    const rules = { eyes: state.stereo !== "off", split: state.mode === "split", gain: state.mode === "difference",
      f: Math.max(...ei) > 1, y: camera.vertical_parallax };
    return (rules[key] ?? true) && !(limit && limit[0] === limit[1]);
  }

  showState() {
    const { state, meta } = this, texts = this.shown();
    for (const input of document.querySelectorAll("[data-state]")) {
      const key = input.dataset.state;
      if (document.activeElement !== input || input.type === "range") input.value = state[key];
      input.disabled = !this.matters(key);
      if (key in texts) input.parentElement.querySelector("output").textContent = texts[key];
    }
    const play = document.getElementById("play"), playing = this.take.playing;
    if (play && play.getAttribute("aria-pressed") !== String(playing)) {
      play.setAttribute("aria-pressed", playing);
      play.textContent = playing ? "Pause" : "Play";
    }
    document.getElementById("zone").hidden = Math.abs(state.x) <= 1 && Math.abs(state.y) <= 1;
    const line = document.getElementById("split"), percent = Math.round(100 * state.split);
    line.hidden = !meta.compared || state.mode !== "split" || state.stereo === "cross-eyed";
    const main = this.pane("main"), { origin, pace } = this.map(main), height = main.height / this.density;
    const edge = (lens) => Math.min(Math.max((lens - origin[1]) / pace[1] / this.density, 0), height);
    Object.assign(line.style, { left: `${100 * state.split}%`, top: `${edge(-0.5)}px`,
      bottom: `${height - edge(meta.lenses[1] - 0.5)}px` });
    document.getElementById("grip").setAttribute("aria-valuenow", percent);
  }

  // --- input -------------------------------------------------------------------------------------------------
  bind() {
    const main = document.getElementById("main");
    const pointers = new Map();
    let moved = 0, panning = false;
    main.addEventListener("pointerdown", (event) => {
      main.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      moved = 0;
      panning = event.shiftKey;
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
      } else if (panning) this.pan(-delta[0], -delta[1]);
      else this.look(-delta[0] / box.width, delta[1] / box.height);
      moved += Math.abs(delta[0]) + Math.abs(delta[1]);
      pointers.set(event.pointerId, now);
    });
    const up = (event) => {
      if (pointers.delete(event.pointerId) && moved < 4 && event.type === "pointerup" && !panning) {
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
      if (input.type === "range") Object.assign(input, { min: limit[0], max: limit[1], step: input.dataset.state === "t" ? 1 : (limit[1] - limit[0]) / 1000 });
      input.addEventListener("input", () => this.set({ [input.dataset.state]: input.value }, input.type === "range"));
    }
    document.getElementById("save").addEventListener("click", () => this.save());
    document.getElementById("reset").addEventListener("click", () => this.set({ ...this.opening }));
    this.bindGrip(main);
    this.bindPlay();
    this.bindWide();
    this.bindTilt();
    window.addEventListener("hashchange", () => {
      this.state = { ...this.opening };
      this.fromLink();
      this.take.seek(this.state.t);
      this.redraw();
    });
  }

  // The space bar plays, unless a button has the keyboard focus.
  bindPlay() {
    document.getElementById("play")?.addEventListener("click", () => this.play(!this.take.playing));
    document.addEventListener("keydown", (event) => {
      if (event.key !== " " || event.target.closest("button, select") || this.meta.frames < 2) return;
      event.preventDefault();
      if (!event.repeat) this.play(!this.take.playing);
    });
  }

  // The split line's own handle: dragged, or moved by arrow keys.
  bindGrip(main) {
    const grip = document.getElementById("grip");
    document.querySelectorAll("#split .half").forEach((half, i) => (half.textContent = this.meta.labels[i]));
    for (const type of ["pointerdown", "pointerup", "pointermove"]) grip.addEventListener(type, (event) => {
      event.stopPropagation();
      if (type === "pointerdown") grip.setPointerCapture(event.pointerId);
      if (type !== "pointermove" || !grip.hasPointerCapture(event.pointerId)) return;
      const box = main.getBoundingClientRect();
      this.set({ split: (event.clientX - box.left) / box.width }, true);
    });
    grip.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      this.set({ split: this.state.split + step }, true);
    });
  }

  // Show the picture alone, on the full screen if the browser allows it.
  bindWide() {
    const show = (wide) => {
      document.body.classList.toggle("wide", wide);
      this.redraw();
    };
    this.widen = async (wide) => {
      show(wide);
      try {
        if (wide) await document.documentElement.requestFullscreen?.();
        else if (document.fullscreenElement) await document.exitFullscreen();
      } catch { /* the browser refuses: the picture fills the window */ }
    };
    document.getElementById("wide").addEventListener("click", () => this.widen(true));
    const narrow = document.getElementById("narrow");
    narrow.addEventListener("click", () => this.widen(false));
    narrow.addEventListener("pointerdown", (event) => event.stopPropagation());
    document.addEventListener("fullscreenchange", () => show(Boolean(document.fullscreenElement)));
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.widen(false));
  }

  // Tilting the device rotates the view like a display: by the same angle, relative to the tilt at switching on.
  bindTilt() {
    const button = document.getElementById("tilt"), radian = Math.PI / 180;
    if (!window.DeviceOrientationEvent || !navigator.maxTouchPoints) return;
    button.hidden = false;
    let first = null;
    const turn = ({ beta, gamma }) => {
      if (beta === null || gamma === null) return;
      first ??= { beta, gamma, x: this.state.x, y: this.state.y };
      const right = first.gamma - gamma, up = beta - first.beta, angle = (screen.orientation?.angle ?? 0) * radian;
      const across = right * Math.cos(angle) - up * Math.sin(angle), above = right * Math.sin(angle) + up * Math.cos(angle);
      const { phi, theta } = this.meta.camera, inside = (value) => Math.min(Math.max(value, -1), 1);
      this.set({ x: inside(first.x + across * radian / phi), y: inside(first.y + above * radian / theta) }, true);
    };
    button.addEventListener("click", async () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      if (on && (await DeviceOrientationEvent.requestPermission?.()) === "denied") return;
      button.setAttribute("aria-pressed", on);
      first = null;
      (on ? addEventListener : removeEventListener)("deviceorientation", turn);
    });
  }

  // Dragging turns the scene: a drag to the right moves the viewer left. A pane's width spans the whole viewing zone.
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

  // Step to another frame, cyclically, and pause.
  stepped(by) {
    this.take.pause();
    return { t: (this.state.t + by + this.meta.frames) % this.meta.frames };
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
      j: () => this.stepped(-1), l: () => this.stepped(1),
      f: () => (this.widen(!document.body.classList.contains("wide")), {}),
      s: () => ({ stereo: { off: "cross-eyed", "cross-eyed": "anaglyph", anaglyph: "off" }[state.stereo] }),
    };
    if (!(event.key in moves) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.set(moves[event.key](), true);
  }
}

// Called by the page when its parts are loaded; text is base64.
const ii = {
  start(meta) {
    try {
      ii.viewer = new Viewer(meta);
    } catch (error) {
      ii.failed(error.message);
    }
  },
  // A still picture is shown below the message.
  failed(message) {
    document.querySelector("#failure p").textContent = message;
    document.getElementById("failure").hidden = false;
  },
  still(source) {
    const image = document.getElementById("still");
    image.src = source;
    image.hidden = false;
  },
  preview(text) {
    ii.still(`data:image/jpeg;base64,${text}`);
    ii.viewer?.preview(ii.viewer.bytes(text));
  },
  page: (picture, layer, frame, text) => ii.viewer?.page(picture, layer, frame, async () => ii.viewer.bytes(text)),
  depth: (text) => ii.viewer?.depth(ii.viewer.bytes(text)),
  // The same from files beside the page, for a picture too large to embed.
  async fetch(order) {
    ii.still(order.find(([kind]) => kind === "preview")[1]);
    if (!ii.viewer) return;
    for (const [kind, name, ...where] of order) {
      if (kind !== "page") {
        ii.viewer[kind](await fileBytes(name));
        continue;
      }
      const [picture, layer, frame, from, to] = where;
      await ii.viewer.page(picture, layer, frame, () => fileBytes(name, from, to));
    }
    ii.done();
  },
  done: () => (ii.ready = ii.viewer?.finished()),
};
