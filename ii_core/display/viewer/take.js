"use strict";
// Frames of a take: cache on the graphics card, loading order, and the playback clock. A still is a take of one frame.

class Take {
  // Calls `changed` after every frame that is shown, and `failed` with the message of a frame that cannot be loaded.
  constructor(meta, field, changed, failed) {
    const bytes = 4 * meta.side ** 2 * meta.pages * (meta.compared ? 2 : 1);
    Object.assign(this, { field, changed, failed, frames: meta.frames, fps: meta.fps, shown: 0, wanted: 0, playing: false });
    this.slots = Math.min(meta.frames, Math.max(2, Math.floor(meta.card_bytes / bytes)));
    this.parts = Array.from({ length: meta.frames }, () => []);
    this.slotOf = new Map();  // slot of every frame that is completely on the card
  }

  // Adds a page of a frame; `source` returns its bytes. Pages of the first frame are shown as soon as they are loaded.
  add(frame, picture, layer, source) {
    this.parts[frame].push([picture, layer, source]);
    if (frame === 0) return source().then((bytes) => this.field.setPage(0, picture, layer, bytes));
  }

  // Called when all frames are known and the first one is on the card.
  ready() {
    this.slotOf.set(0, 0);
    this.pump();
  }

  // Show a frame as soon as it is on the card; playback continues from it.
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

  // Load frames, one at a time, until the wanted one and as many after it as fit are on the card. During playback a
  // late frame is shown, too: slow loading skips frames, but playback never stops.
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

  // Return a free slot, or the slot of the frame that is needed last.
  room() {
    const used = new Set(this.slotOf.values());
    for (let slot = 0; slot < this.slots; slot++) if (!used.has(slot)) return slot;
    const until = (frame) => (frame - this.wanted + this.frames) % this.frames;
    const last = [...this.slotOf.keys()].filter((frame) => frame !== this.shown).sort((a, b) => until(b) - until(a))[0];
    const slot = this.slotOf.get(last);
    this.slotOf.delete(last);
    return slot;
  }

  // Play in a loop from the wanted frame on, at the take's rate; `ticked` is called with the frame that is due.
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

// Fetch a file beside the page, or its bytes from … to − 1. A server without range requests sends the whole file.
async function fileBytes(name, from, to) {
  const answer = await fetch(name, from === undefined ? {} : { headers: { Range: `bytes=${from}-${to - 1}` } });
  if (!answer.ok) throw new Error(`${name} cannot be loaded: the server answers ${answer.status}`);
  const bytes = new Uint8Array(await answer.arrayBuffer());
  return from === undefined || answer.status === 206 ? bytes : bytes.slice(from, to);
}
