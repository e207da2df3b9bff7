"use strict";
// What page and report have in common: the timeline.

const byId = id => document.getElementById(id);

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

// text only where it has changed: what is read aloud is read once
function put(where, text) { if (where.textContent !== text) where.textContent = text; }

// the result of a visit: a visitor's choice is no failure
const KINDS = {"complete": "S", "complete without steps": "w", "broken off": "F", "declined": "d", "left": "d", "no reaction": "d", "stopped": "h"};
const ICONS = {S: "✔", w: "✔", F: "✘", d: "○", h: "■"};

function sign(result) { return element("b", "sign " + KINDS[result], ICONS[KINDS[result]]); }

// a path may be broken after each slash
function breakable(where, text) {
  where.append(...text.split(/(?<=\w\/)/).flatMap(part => [part, element("wbr")]));
  return where;
}

let spoken = "";  // the code of the language that the robot speaks, if that is not the page's

// a text whose quotations are in the language of the robot
function quoting(text) {
  return text.split(/(“[^”]*”)/).map(part => {
    if (!spoken || !part.startsWith("“")) return part;
    const made = element("span", "", part);
    made.lang = spoken;
    return made;
  });
}

// what is chosen in a list that is one tab stop is walked by the arrow keys
function walkByArrows(box, chosen) {
  box.addEventListener("keydown", event => {
    const step = {ArrowDown: 1, ArrowUp: -1}[event.key];
    if (!step) return;
    const all = [...box.querySelectorAll(chosen)].filter(one => one.offsetParent), place = all.indexOf(document.activeElement);
    const next = all[place < 0 ? (step > 0 ? 0 : all.length - 1) : place + step];
    if (next) next.focus();
    event.preventDefault();
  });
}

const INSTANT = 50;  // milliseconds; what takes less is done at once
const NEAR = 3;      // pixels between two bars of a kind that are drawn as one
const FEW = 6;       // lanes of values that are shown at first
const TOLD = 20;     // changes of a value that are read aloud: the newest

function duration(length) {  // milliseconds
  const seconds = length / 1000;
  if (seconds < 60) return seconds.toFixed(seconds < 10 ? 1 : 0) + " s";
  const minutes = Math.floor(Math.round(seconds) / 60);
  return minutes < 60 ? minutes + " min " + Math.round(seconds) % 60 + " s" : Math.floor(minutes / 60) + " h " + minutes % 60 + " min";
}

// the lane of a value: ``changes`` are times and texts, an empty one where it has none
function valueLane(name, changes, end) {
  const bars = changes.map(([begin, text], place) => (
    {begin: Math.max(0, begin), end: place + 1 < changes.length ? changes[place + 1][0] : end, kind: "v", count: 1, text}));
  return {name, isValue: true, bars: bars.filter(bar => bar.text && bar.end >= bar.begin)};
}

// Lanes of bars, and the stretch of time that is seen, from 0 to ``length`` at most: milliseconds. Buttons, keys, the
// pointer, and the wheel with Ctrl zoom and move it. A lane has a name, a link or none, and bars in order: {begin, end, kind,
// count, text}.
class Timeline {
  // ``clock`` labels a time on an axis with that tick; ``words`` has the kinds of bars; ``choose`` is called with a lane, a
  // bar and what is told of it, ``drawn`` with the number of lanes without bars; so many lanes are ``above`` those of values
  constructor(box, length, {clock, words, choose, drawn, least = 95, above = 0}) {
    this.length = Math.max(length, Timeline.SHORTEST);
    [this.from, this.to, this.lanes, this.axis, this.width] = [0, this.length, [], element("div", "axis"), 50];
    Object.assign(this, {box, clock, words, choose, drawn, least, above, values: element("div", "values"), hasAll: false});
    box.append(this.axis);
    this.listen();
  }

  listen() {
    const zoomIn = () => this.zoom(0.5), zoomOut = () => this.zoom(2);
    for (const [id, act] of [["in", zoomIn], ["out", zoomOut], ["earlier", () => this.move(-0.5)], ["later", () => this.move(0.5)]])
      byId(id).addEventListener("click", act);
    const keys = {ArrowLeft: () => this.move(-0.25), ArrowRight: () => this.move(0.25), "+": zoomIn, "=": zoomIn, "-": zoomOut,
                  Home: () => this.showAll()};
    this.box.addEventListener("keydown", event => {
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
    });
    this.box.addEventListener("pointerdown", event => this.drag(event));
    this.box.addEventListener("dblclick", event => this.zoom(0.5, this.timeAt(event)));
    this.box.addEventListener("wheel", event => {
      if (!event.ctrlKey) return;  // else the page scrolls
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? 1.25 : 0.8, this.timeAt(event));
    }, {passive: false});
    byId("all-values").addEventListener("click", () => {
      this.hasAll = !this.hasAll;
      byId("all-values").setAttribute("aria-pressed", this.hasAll);
      this.draw();
    });
    addEventListener("resize", () => this.draw());
  }

  get isWhole() { return this.from === 0 && this.to === this.length; }
  get scale() { return this.width / (this.to - this.from); }  // pixels of a millisecond
  get tick() { return Timeline.TICKS.find(each => each * this.scale > this.least) || this.to - this.from; }

  show(from, to) {
    const length = Math.min(Math.max(to - from, Timeline.SHORTEST), this.length);
    this.from = Math.min(Math.max(from, 0), this.length - length);
    this.to = this.from + length;
    this.draw();
  }

  showAll() { this.show(0, this.length); }
  move(part) { this.show(this.from + (this.to - this.from) * part, this.to + (this.to - this.from) * part); }

  zoom(factor, around = (this.from + this.to) / 2) {
    this.show(around - (around - this.from) * factor, around + (this.to - around) * factor);
  }

  timeAt(event) { return this.from + (event.clientX - this.axis.getBoundingClientRect().left) / this.scale; }

  drag(event) {
    if (event.button !== 0 || event.target.closest("a")) return;
    const {from, to, scale} = this;
    const follow = moved => {
      const shift = (moved.clientX - event.clientX) / scale;
      if (Math.abs(moved.clientX - event.clientX) > 3) this.show(from - shift, to - shift);
    };
    addEventListener("pointermove", follow);
    for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => removeEventListener("pointermove", follow), {once: true});
  }

  // a lane that was there keeps its row
  setLanes(lanes) {
    const key = lane => lane.name + (lane.isValue ? " =" : ""), keys = some => some.map(key).join("\n");
    const rows = new Map(this.lanes.map(lane => [key(lane), lane.row])), before = keys(this.lanes);
    for (const lane of lanes) lane.row = rows.get(key(lane)) || this.makeRow(lane);
    this.lanes = lanes;
    if (before !== keys(lanes)) {
      const others = lanes.filter(lane => !lane.isValue).map(lane => lane.row);
      this.values.replaceChildren(...lanes.filter(lane => lane.isValue).map(lane => lane.row));
      this.box.replaceChildren(this.axis, ...others.slice(0, this.above), this.values, ...others.slice(this.above));
    }
    this.draw();
  }

  makeRow(lane) {
    const row = element("div", "lane"), track = element("div", "track"), head = element(lane.link ? "a" : "span", "", lane.name);
    if (lane.link) head.href = "#" + lane.link;
    head.title = lane.name;
    track.setAttribute("role", "img");
    row.append(head, track);
    return row;
  }

  draw() {
    this.width = Math.max(50, this.axis.clientWidth);
    const {scale} = this, few = this.hasAll ? Infinity : FEW;
    let empty = 0, values = 0;
    for (const lane of this.lanes) {
      const bars = this.merged(lane.bars, scale);
      lane.row.hidden = !bars.length || Boolean(lane.isValue) && ++values > few;
      empty += !bars.length;
      lane.row.lastChild.setAttribute("aria-label", lane.isValue ? this.told(lane) : this.counted(lane));
      lane.row.lastChild.replaceChildren(...bars.map(bar => this.barElement(lane, bar, scale)));
    }
    this.values.classList.toggle("all", this.hasAll);
    byId("all-values").hidden = values <= FEW;
    put(byId("all-values"), "All " + values + " values");
    this.drawAxis(scale);
    this.drawn(empty);
  }

  counted(lane) {
    const counts = {}, longest = lane.bars.reduce((most, bar) => Math.max(most, bar.end - bar.begin), 0);
    for (const bar of lane.bars) counts[this.words[bar.kind]] = (counts[this.words[bar.kind]] || 0) + bar.count;
    return lane.name + ": " + Object.entries(counts).map(([word, count]) => count + " " + word).join(", ") + "; the longest took " + duration(longest);
  }

  told(lane) {
    const older = Math.max(0, lane.bars.length - TOLD), told = lane.bars.slice(older).map(bar => bar.text + " at " + this.clock(bar.begin, this.tick));
    return lane.name + ": " + (older ? older + " earlier values, " : "") + told.join(", ");
  }

  // bars of a kind that would touch are one, with the count of what is in it
  merged(bars, scale) {
    const found = [], newest = {};
    for (const bar of bars) {
      const isMoment = bar.begin === bar.end;
      if (isMoment ? bar.end < this.from || bar.begin > this.to : bar.end <= this.from || bar.begin >= this.to) continue;
      const last = newest[bar.kind];
      if (last && (bar.begin - last.end) * scale < NEAR && (last.end - last.begin) * scale < 4 * NEAR && (bar.end - bar.begin) * scale < NEAR) {
        last.end = Math.max(last.end, bar.end);
        last.count += bar.count;
        if (last.text !== bar.text) last.text = "";
      } else {
        newest[bar.kind] = Object.assign({}, bar);
        found.push(newest[bar.kind]);
      }
    }
    return found;
  }

  telling(lane, bar) {
    const length = bar.end - bar.begin;
    return [lane.name + ":", bar.count > 1 ? bar.count + " ×" : "", this.words[bar.kind], bar.text && bar.text !== lane.name ? bar.text + "," : "",
            "at " + this.clock(bar.begin, this.tick), length ? "for " + duration(length) : ""].filter(Boolean).join(" ");
  }

  // of the width: paper has another one than the screen
  share(time) { return 100 * time / (this.to - this.from) + "%"; }

  barElement(lane, bar, scale) {
    const begin = Math.max(bar.begin, this.from), length = Math.min(bar.end, this.to) - begin;
    const made = element("span", "bar " + bar.kind + (length * scale > 45 ? " wide" : ""));
    made.style.left = this.share(begin - this.from);
    made.style.width = this.share(length);
    if (bar.kind === "v") made.textContent = bar.text;
    else if (length * scale > 45)
      made.textContent = (bar.kind === "d" || lane.isNamed ? bar.text + " " : bar.count > 1 ? bar.count + " in " : "") + duration(bar.end - bar.begin);
    made.title = this.telling(lane, bar);
    made.addEventListener("click", () => this.choose(lane, bar, made.title));
    return made;
  }

  drawAxis(scale) {
    const {tick} = this, marks = [], origin = this.origin % tick;
    const first = Math.ceil((this.from + origin) / tick) * tick - origin;
    for (let time = first; time <= this.to; time += tick) {
      const mark = element("span", "", this.clock(time, tick));
      mark.style.left = this.share(time - this.from);
      if ((this.to - time) * scale > this.least - 25) marks.push(mark);
    }
    this.axis.replaceChildren(...marks);
    this.box.style.setProperty("--first", this.share(first - this.from));
    this.box.style.setProperty("--tick", this.share(tick));
  }
}
Timeline.prototype.origin = 0;  // the time of day at which it begins, for ticks at full minutes
Timeline.SHORTEST = 50;
Timeline.TICKS = [10, 20, 50, 100, 200, 500, 1e3, 2e3, 5e3, 1e4, 15e3, 3e4, 6e4, 12e4, 3e5, 6e5, 18e5, 36e5, 72e5, 216e5, 864e5, 6048e5];
