"use strict";
// A test with observers. Results are lines of JSON; each holds the SHA-256 of the line before it and its own text.
const CARD_MM = 85.6, HEIGHTS = 3; // viewing distance in heights of a picture
const byId = (id) => document.getElementById(id);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const clicked = (...buttons) => new Promise((done) => {
  for (const button of buttons) button.onclick = () => done(button);
});
const ii = {
  blobs: [], plates: [],
  frame(stimulus, place, data) { (ii.blobs[stimulus] ??= [])[place] = blob(data, "image/webp"); },
  plate(number, _, data) { ii.plates[number] = `data:image/png;base64,${data}`; },
  start(text, served) { Object.assign(ii, { text, served, plan: JSON.parse(text) }); },
};
ii.ready = new Promise((done) => { ii.done = () => { done(); run(); }; });

function blob(data, type) {
  return new Blob([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], { type });
}

function show(id) {
  for (const section of document.querySelectorAll("section")) section.hidden = section.id !== id;
}

async function sha256(text) {
  const digest = await crypto.subtle.digest("SHA-256", new TextEncoder().encode(text));
  return Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

// Answers of one observer: stored in the browser at once, and sent to the server until it accepts them.
class Answers {
  constructor(observer, lines = []) {
    Object.assign(this, { observer, lines, sent: 0, writing: Promise.resolve(), sending: null });
    this.records = lines.map((line) => JSON.parse(line));
  }

  static prefix = "";

  static earlier() {
    try {
      return Object.keys(localStorage).filter((key) => key.startsWith(Answers.prefix))
        .map((key) => new Answers(Number(key.slice(Answers.prefix.length)), localStorage[key].trim().split("\n")))
        .sort((a, b) => a.observer - b.observer);
    } catch { return []; }
  }

  get given() { return this.records.filter((record) => record.kind === "answer").length; }
  get ended() { return this.records.at(-1)?.kind === "end"; }
  get text() { return this.lines.join("\n") + "\n"; }

  append(kind, rest = {}) {
    const record = { kind, at: new Date().toISOString(), ...rest };
    this.records.push(record);
    this.writing = this.writing.then(async () => {
      const text = JSON.stringify(record), before = this.lines.at(-1)?.slice(-66, -2) ?? "";
      this.lines.push(`${text.slice(0, -1)},"check":"${await sha256(before + text)}"}`);
      try {
        localStorage.setItem(Answers.prefix + this.observer, this.text);
      } catch {
        if (!ii.served) byId("status").textContent = "This browser stores nothing: a closed tab would lose the answers.";
      }
      if (ii.served) this.send();
    });
    return this.writing;
  }

  send() {
    this.sending ??= this.post().finally(() => { this.sending = null; if (this.sent < this.lines.length) this.send(); });
    return this.sending;
  }

  async post() {
    const count = this.lines.length, headers = { "Content-Type": "application/json" };
    let refused = "";
    try {
      const reply = await fetch(`results/${this.observer}`, { method: "POST", headers, body: this.text });
      if (reply.ok) this.sent = count;
      else refused = ` (${reply.status})`;
    } catch { /* no server: the answers stay in the browser's storage */ }
    byId("status").textContent = this.sent < count ? `The server has not accepted the last answers${refused}: trying again.` : "";
    if (this.sent < count) await pause(1000);
  }

  download() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([this.text], { type: "application/jsonl" }));
    link.download = `observer-${String(this.observer).padStart(3, "0")}.jsonl`;
    link.click();
  }
}

async function run() {
  const { plan } = ii;
  Answers.prefix = `ii-observer ${(await sha256(ii.text)).slice(0, 16)} `;
  const answers = await begin();
  ii.answers = answers;
  const presentations = [...plan.training, ...plan.orders[(answers.observer - 1) % plan.orders.length]];
  for (let place = answers.given; place < presentations.length; place++) {
    const training = place < plan.training.length, main = place - plan.training.length;
    if (place === 0 && training) await message("Training", "The first pictures show what to expect. Their answers do not count.");
    if (main === 0) await message("The test", "From now on the answers count.");
    if (main > 0 && main % plan.block === 0) await rest(answers, main, presentations.length - place);
    const answer = await presentation(presentations[place]);
    await answers.append("answer", { place, training, pair: presentations[place], ...answer });
  }
  if (!answers.ended) await answers.append("end");
  await ended(answers);
}

async function begin() {
  const { plan } = ii, kind = plan.method;
  byId("task").textContent = kind === "dsis"
    ? "You see a reference and then a second picture of the same scene. Say how visible its impairments are, compared with the reference."
    : "You see two pictures of the same scene beside each other. Say which one is better.";
  const count = plan.orders[0].length + plan.training.length, each = kind === "dsis" ? 2 * plan.seconds + plan.grey_seconds : plan.seconds;
  byId("length").textContent = `${count} times, about ${Math.ceil(count * (each + 3) / 60)} minutes, with a break after every ${plan.block}.`;
  const earlier = Answers.earlier(), buttons = [byId("begin")];
  for (const one of earlier) {
    const row = document.createElement("p"), load = document.createElement("button");
    row.textContent = `Observer ${one.observer}: ${one.given} of ${count} answers. `;
    load.textContent = "Download";
    load.addEventListener("click", () => one.download());
    row.append(load);
    if (!one.ended) {
      const go = Object.assign(document.createElement("button"), { textContent: "Continue", answers: one });
      buttons.push(go);
      row.append(" ", go);
    }
    byId("earlier").append(row);
  }
  byId("which").hidden = ii.served;
  byId("observer").value = /observer=(\d+)/.exec(location.hash)?.[1] ?? 1 + Math.max(0, ...earlier.map((one) => one.observer));
  show("start");
  for (;;) {
    const { answers } = await clicked(...buttons);
    if (answers) {
      await screenSize();
      await answers.append("resume", screenNow());
      return answers;
    }
    const observer = ii.served ? await numbered() : Number(byId("observer").value);
    if (!(Number.isInteger(observer) && observer >= 1 && observer <= 9999)) continue;
    if (earlier.some((one) => one.observer === observer)) {
      byId("status").textContent = `Observer ${observer} has answers here already: choose another number, or continue.`;
      continue;
    }
    byId("status").textContent = "";
    const fresh = new Answers(observer);
    await screenSize();
    const colour_vision = await colours();
    await fresh.append("begin", { format: "ii-observer", version: 1, plan: ii.text, observer, colour_vision, ...screenNow() });
    return fresh;
  }
}

async function numbered() {
  try {
    const reply = await fetch("results", { method: "POST", headers: { "Content-Type": "application/json" } });
    if (reply.ok) return (await reply.json()).observer;
  } catch { /* reported below */ }
  byId("status").textContent = "The server does not answer: start it again, then begin.";
  return 0;
}

// Size of a view on the page in CSS pixels, a whole number of pixels of the screen.
function viewSize() {
  const scale = ii.plan.zoom / devicePixelRatio;
  return [ii.plan.size[0] * scale, ii.plan.size[1] * scale];
}

function screenNow() {
  return { px_per_mm: byId("width").value / CARD_MM, device_pixel_ratio: devicePixelRatio,
    screen: [screen.width, screen.height], window: [innerWidth, innerHeight] };
}

async function screenSize() {
  show("screen");
  const [width, height] = viewSize(), beside = ii.plan.method === "pairs" ? 2 : 1;
  const needed = [beside * (width + 16) + 32, height + 200];
  const update = () => {
    byId("card").style.width = `${byId("width").value}px`;
    const far = HEIGHTS * height / (byId("width").value / CARD_MM) / 10;
    byId("distance").textContent = `Sit about ${Math.round(far)} cm from the screen: ${HEIGHTS} times the height of a picture.`;
    const fits = innerWidth >= needed[0] && innerHeight >= needed[1];
    byId("small").hidden = fits;
    byId("small").textContent = `The window is ${innerWidth}×${innerHeight}: ${Math.ceil(needed[0])}×${Math.ceil(needed[1])} are needed. Make it larger, or press F11.`;
    byId("sized").disabled = !fits;
  };
  byId("width").oninput = window.onresize = update;
  update();
  await clicked(byId("sized"));
  window.onresize = null;
}

async function colours() {
  show("colours");
  let wrong = 0;
  byId("digits").replaceChildren(...["–", 1, 2, 3, 4, 5, 6, 7, 8, 9].map((digit) =>
    Object.assign(document.createElement("button"), { textContent: digit, value: digit })));
  for (const [number, digit] of ii.plan.plates.entries()) {
    byId("plate").src = ii.plates[number];
    const { value } = await clicked(...byId("digits").children);
    wrong += value !== String(digit);
  }
  return wrong <= 1 ? "passed" : "failed";
}

async function message(heading, text) {
  byId("heading").textContent = heading;
  byId("text").textContent = text;
  show("message");
  byId("next").focus();
  await clicked(byId("next"));
  show("stage");
}

async function rest(answers, after, left) {
  const began = performance.now();
  await message("Break", `${left} are left. Rest your eyes, and go on when you are ready.`);
  await answers.append("break", { after, seconds: Math.round((performance.now() - began) / 100) / 10 });
}

// Show one presentation; restart it whenever the tab was hidden.
async function presentation(pair) {
  const films = await Promise.all(pair.map((stimulus) => Promise.all(ii.blobs[stimulus].map((one) => createImageBitmap(one)))));
  const { method, seconds, grey_seconds: grey } = ii.plan, [left, right] = [byId("left"), byId("right")];
  show("stage");
  for (let repeated = 0; ; repeated++) {
    byId("vote").hidden = true;
    right.hidden = method === "dsis";
    let seen;
    if (method === "dsis") {
      seen = [await play([[left, films[0]]], seconds, "Reference")];
      await blank(grey);
      seen.push(await play([[left, films[1]]], seconds, "Second picture"));
      await blank(0);
    } else {
      const answered = vote();
      seen = [await play([[left, films[0]], [right, films[1]]], seconds, "Which picture is better?", answered)];
      await blank(0);
      if (!seen.includes(null)) return closed(films, { ...await answered, repeated, shown_ms: seen });
      continue;
    }
    if (!seen.includes(null)) return closed(films, { ...await vote(), repeated, shown_ms: seen });
  }
}

function closed(films, answer) {
  for (const film of films) for (const bitmap of film) bitmap.close();
  return answer;
}

// Show films until the time is up or an answer is given; return the milliseconds, or null if the tab was hidden.
async function play(films, seconds, caption, answered) {
  const { sequence, fps } = ii.plan, [width, height] = viewSize();
  let done = false, hidden = document.hidden;
  answered?.then(() => { done = true; });
  byId("caption").textContent = caption;
  for (const [canvas, film] of films) {
    [canvas.width, canvas.height] = [film[0].width, film[0].height];
    [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
    canvas.classList.remove("grey");
  }
  const watch = () => { hidden ||= document.hidden; };
  document.addEventListener("visibilitychange", watch);
  let began, now;
  do {
    now = await new Promise(requestAnimationFrame);
    began ??= now;
    const frame = sequence[Math.floor((now - began) / 1000 * fps) % sequence.length];
    for (const [canvas, film] of films) canvas.getContext("2d").drawImage(film[frame], 0, 0);
  } while (now - began < seconds * 1000 && !done && !hidden);
  document.removeEventListener("visibilitychange", watch);
  return hidden ? null : Math.round(now - began);
}

async function blank(seconds) {
  for (const id of ["left", "right"]) byId(id).classList.add("grey");
  byId("caption").textContent = "";
  await pause(seconds * 1000);
}

let voting = null;
function vote() {
  voting?.abort(); // voting of a presentation that restarts
  voting = new AbortController();
  const dsis = ii.plan.method === "dsis", began = performance.now();
  const choices = dsis ? ii.plan.grades.map((text, i) => [5 - i, text, String(5 - i)])
    : [["left", "left", "ArrowLeft"], ["same", "the same", " "], ["right", "right", "ArrowRight"]];
  byId("question").textContent = dsis ? "The impairments are:" : "The better picture is:";
  byId("answers").replaceChildren(...choices.map(([value, text, key]) => {
    const button = document.createElement("button"), name = document.createElement("kbd");
    name.textContent = dsis ? ` ${key}` : ` ${{ ArrowLeft: "←", " ": "space", ArrowRight: "→" }[key]}`;
    button.append(text, name);
    return Object.assign(button, { value, answer: value });
  }));
  byId("vote").hidden = false;
  return new Promise((done) => {
    const answered = (answer) => {
      voting.abort();
      byId("vote").hidden = true;
      done({ answer, answer_ms: Math.round(performance.now() - began) });
    };
    const pressed = (event) => {
      const choice = choices.find(([, , key]) => key === event.key);
      if (choice && !event.repeat) { event.preventDefault(); answered(choice[0]); }
    };
    document.addEventListener("keydown", pressed, { signal: voting.signal });
    for (const button of byId("answers").children) button.onclick = () => answered(button.answer);
  });
}

async function ended(answers) {
  show("end");
  byId("download").onclick = () => answers.download();
  byId("saved").textContent = ii.served ? "Saving the answers …" : "Please download the answers and hand the file over.";
  if (!ii.served) return;
  while (answers.sent < answers.lines.length) await answers.send();
  byId("saved").textContent = "All answers are saved.";
}

addEventListener("beforeunload", (event) => {
  if (ii.answers && !ii.answers.ended) event.preventDefault();
});
