"use strict";
// Frames of a take: which are on the card, which are loaded next, and the clock that plays them. A still is a take of
// one frame.

class Take {
  // `changed` follows every frame that is shown; `failed` gets the message of a frame that cannot be loaded.
  constructor(meta, field, changed, failed) {
    const bytes = 4 * meta.side ** 2 * meta.pages * (meta.compared ? 2 : 1);
    Object.assign(this, { field, changed, failed, frames: meta.frames, fps: meta.fps, shown: 0, wanted: 0, playing: false });
    this.slots = Math.min(meta.frames, Math.max(2, Math.floor(meta.card_bytes / bytes)));
    this.parts = Array.from({ length: meta.frames }, () => []);
    this.slotOf = new Map();  // of every frame that is whole on the card
  }

  // A page of a frame; `source` returns its bytes. Pages of the first frame are shown as they come.
  add(frame, picture, layer, source) {
    this.parts[frame].push([picture, layer, source]);
    if (frame === 0) return source().then((bytes) => this.field.setPage(0, picture, layer, bytes));
  }

  // All frames are known and the first is on the card.
  ready() {
    this.slotOf.set(0, 0);
    this.pump();
  }

  // Show a frame as soon as it is on the card, and go on from it while playing.
  seek(frame) {
    this.begun = null;
    this.want(frame);
  }

  want(frame) {
    this.wanted = frame;
    if (this.slotOf.has(frame)) this.present(frame);
    this.pump();
  }

  present(frame) {
    this.field.shown = this.slotOf.get(frame);
    if (frame === this.shown) return;
    this.shown = frame;
    this.changed();
  }

  // Load frames, one at a time, until the wanted one and as many after it as have room are on the card. While
  // playing, a frame that comes too late is shown all the same: slow loading leaves out frames, but never stops.
  async pump() {
    if (this.busy || !this.slotOf.size) return;
    this.busy = true;
    try {
      for (let next = this.next(); next !== null; next = this.next()) {
        const awaited = next === this.wanted;
        await this.load(next);
        if (next === this.wanted || (awaited && this.playing)) this.present(next);
      }
    } catch (error) {
      this.playing = false;
      this.failed(`${error.message}`);
    }
    this.busy = false;
  }

  next() {
    for (let ahead = 0; ahead < this.slots; ahead++) {
      const frame = (this.wanted + ahead) % this.frames;
      if (!this.slotOf.has(frame)) return frame;
    }
    return null;
  }

  async load(frame) {
    const slot = this.room();
    const pages = this.parts[frame].map(async ([picture, layer, source]) =>
      this.field.setPage(slot, picture, layer, await source()));
    await Promise.all(pages);
    this.slotOf.set(frame, slot);
  }

  // A slot without a frame; if there is none, that of the frame that is needed last.
  room() {
    const used = new Set(this.slotOf.values());
    for (let slot = 0; slot < this.slots; slot++) if (!used.has(slot)) return slot;
    const until = (frame) => (frame - this.wanted + this.frames) % this.frames;
    const last = [...this.slotOf.keys()].filter((frame) => frame !== this.shown).sort((a, b) => until(b) - until(a))[0];
    const slot = this.slotOf.get(last);
    this.slotOf.delete(last);
    return slot;
  }

  // Play from the wanted frame on, over and over, at the take's rate; `ticked` gets the frame that is due.
  play(ticked) {
    if (this.playing || this.frames < 2) return;
    this.playing = true;
    this.begun = null;
    const step = (now) => {
      if (!this.playing) return;
      this.begun ??= now - (1000 * this.wanted) / this.fps;
      const due = Math.floor(((now - this.begun) / 1000) * this.fps + 1e-6) % this.frames;
      if (due !== this.wanted) {
        this.want(due);
        ticked(due);
      }
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.playing = false;
  }
}

// A file beside the page, or its bytes from … to − 1. A server without range requests sends the whole file.
async function fileBytes(name, from, to) {
  const answer = await fetch(name, from === undefined ? {} : { headers: { Range: `bytes=${from}-${to - 1}` } });
  if (!answer.ok) throw new Error(`${name} cannot be loaded: the server answers ${answer.status}`);
  const bytes = new Uint8Array(await answer.arrayBuffer());
  return from === undefined || answer.status === 206 ? bytes : bytes.slice(from, to);
}
