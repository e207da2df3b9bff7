"use strict";
// What page and report have in common.

const byId = id => document.getElementById(id);

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

const INSTANT = 50;  // milliseconds; what takes less is done at once

function duration(length) {  // milliseconds
  const seconds = length / 1000;
  if (seconds < 60) return seconds.toFixed(seconds < 10 ? 1 : 0) + " s";
  const minutes = Math.floor(Math.round(seconds) / 60);
  return minutes < 60 ? minutes + " min " + Math.round(seconds) % 60 + " s" : Math.floor(minutes / 60) + " h " + minutes % 60 + " min";
}

// The stretch of a timeline that is seen, from 0 to ``length`` at most: milliseconds. Buttons, keys, the pointer, and the
// wheel with Ctrl zoom and move it.
class Stretch {
  // ``box`` takes the keys; ``track`` returns the rectangle that the stretch fills; ``draw`` draws what is seen
  constructor(box, length, track, draw) {
    this.length = Math.max(length, Stretch.SHORTEST);
    [this.from, this.to, this.track, this.draw] = [0, this.length, track, draw];
    const zoomIn = () => this.zoom(0.5), zoomOut = () => this.zoom(2);
    for (const [id, act] of [["in", zoomIn], ["out", zoomOut], ["earlier", () => this.move(-0.5)], ["later", () => this.move(0.5)]])
      byId(id).addEventListener("click", act);
    const keys = {ArrowLeft: () => this.move(-0.25), ArrowRight: () => this.move(0.25), "+": zoomIn, "=": zoomIn, "-": zoomOut,
                  Home: () => this.showAll()};
    box.addEventListener("keydown", event => {
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
    });
    box.addEventListener("pointerdown", event => this.drag(event));
    box.addEventListener("dblclick", event => this.zoom(0.5, this.timeAt(event)));
    box.addEventListener("wheel", event => {
      if (!event.ctrlKey) return;  // else the page scrolls
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? 1.25 : 0.8, this.timeAt(event));
    }, {passive: false});
  }

  get isWhole() { return this.from === 0 && this.to === this.length; }
  get scale() { return this.track().width / (this.to - this.from); }  // pixels of a millisecond
  get tick() { return Stretch.TICKS.find(each => each * this.scale > 95) || this.to - this.from; }

  show(from, to) {
    const length = Math.min(Math.max(to - from, Stretch.SHORTEST), this.length);
    this.from = Math.min(Math.max(from, 0), this.length - length);
    this.to = this.from + length;
    this.draw();
  }

  showAll() { this.show(0, this.length); }
  move(part) { this.show(this.from + (this.to - this.from) * part, this.to + (this.to - this.from) * part); }

  zoom(factor, around = (this.from + this.to) / 2) {
    this.show(around - (around - this.from) * factor, around + (this.to - around) * factor);
  }

  timeAt(event) { return this.from + (event.clientX - this.track().left) / this.scale; }

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
}
Stretch.SHORTEST = 50;
Stretch.TICKS = [10, 20, 50, 100, 200, 500, 1e3, 2e3, 5e3, 1e4, 15e3, 3e4, 6e4, 12e4, 3e5, 6e5, 18e5, 36e5, 72e5, 216e5, 864e5, 6048e5];
