"use strict";
// Shows what /events tells: a part of the board arrives whole whenever it has changed.

const SIGNS = {R: "▶", S: "✔", F: "✘", s: "✔", f: "✘", r: "■", "-": "·"};
const WORDS = {R: "running", S: "success", F: "failure", s: "success before", f: "failure before", r: "halted",
               "-": "not yet ticked"};
const byId = id => document.getElementById(id);
let items = [];      // tree items by uid - 1
let letters = "";    // the status of each, as shown
let tip = 0;         // uid of the running leaf
let follow = true;
let opened = new Set();  // items that only the running leaf has unfolded

const LATE = 2;      // seconds without a message after which what is shown may be old; the node sends one every second
const RETRY = 10;    // seconds without a message after which the page connects again
let source = null;
let heard = seconds();    // when the last message came
let lastTry = seconds();
let hasConnection = true;
let alive = {age: null, hangs: false};  // the tick thread's last sign of life, as of the last message
let ended = "";           // how the mission ended
let ages = [];            // elements that show the age of a topic's last message

function seconds() { return performance.now() / 1000; }

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

// ------------------------------------------------------------------------------------------------------------ tree

const DEEPEST = 100;  // nested lists; browsers give up far beyond, so what is deeper stands beside its parent

function item(node) {
  const parent = items[node.parent - 1];
  const level = parent ? Number(parent.getAttribute("aria-level")) + 1 : 1;
  const made = element("li", node.subtree ? "subtree" : "");
  made.setAttribute("role", "treeitem");
  made.setAttribute("aria-level", level);
  made.tabIndex = -1;
  made.dataset.uid = node.uid;
  const row = element("div", "row");
  row.title = node.path;
  row.append(element("span", "fold"), element("span", "sign", SIGNS["-"]), element("span", "name", node.name));
  if (node.kind) row.append(element("span", "type", node.kind));
  row.addEventListener("click", () => { focus(made); fold(made, isOpen(made)); });
  made.append(row);
  items[node.uid - 1] = made;
  if (parent) groupFor(parent, level).append(made);
  return made;
}

function groupFor(parent, level) {
  if (level > DEEPEST) return parent.parentElement;
  if (parent.lastChild.getAttribute("role") !== "group") {
    const group = element("ul");
    group.setAttribute("role", "group");
    parent.append(group);
    parent.setAttribute("aria-expanded", parent.classList.contains("subtree") ? "false" : "true");
  }
  return parent.lastChild;
}

function showMission(mission) {
  byId("mission").textContent = "Mission " + mission.file.split("/").pop().replace(/\.xml$/, "");
  document.title = byId("mission").textContent;
  items = [];
  letters = "";
  opened = new Set();
  byId("tree").replaceChildren();
  if (!mission.nodes.length) return;
  mission.nodes.forEach(item);
  items[0].tabIndex = 0;
  byId("tree").append(items[0]);
}

const isOpen = one => one.getAttribute("aria-expanded") === "true";
function fold(one, closed) {
  if (one.hasAttribute("aria-expanded")) one.setAttribute("aria-expanded", closed ? "false" : "true");
  opened.delete(one);
}

function parentItem(one) { return one.parentElement.closest("[role=treeitem]"); }

function showStatuses(statuses) {
  for (let place = 0; place < items.length; place++) {
    const letter = statuses.letters[place] || "-";
    if (letters[place] === letter) continue;
    const one = items[place];
    one.classList.remove("R", "S", "F", "s", "f", "r");
    if (letter !== "-") one.classList.add(letter);
    one.firstChild.children[1].textContent = SIGNS[letter];
    one.setAttribute("aria-label", one.querySelector(".name").textContent + ": " + WORDS[letter]);
  }
  letters = statuses.letters;
  tip = statuses.tip;
  for (const one of document.querySelectorAll(".tip")) one.classList.remove("tip");
  const current = items[tip - 1];
  if (current) current.classList.add("tip");
  byId("now").textContent = current ? "now: " + whereabouts(current) : "nothing runs";
  if (follow) goToTip();
}

// the subtrees around an item, and the item itself
function whereabouts(one) {
  const names = [...one.firstChild.children].slice(2).map(part => part.textContent);
  const around = [];
  for (let outer = parentItem(one); outer; outer = parentItem(outer))
    if (outer.classList.contains("subtree")) around.unshift(outer.querySelector(".name").textContent);
  return around.concat(names.join(" ")).join(" › ");
}

function goToTip() {
  const current = items[tip - 1];
  const path = new Set();
  for (let one = current; one; one = parentItem(one)) path.add(one);
  for (const one of [...opened]) if (!path.has(one)) fold(one, true);
  for (const one of path) if (one !== current && !isOpen(one)) { fold(one, false); opened.add(one); }
  if (!current) return;
  const box = byId("tree").getBoundingClientRect(), row = current.firstChild.getBoundingClientRect();
  if (row.top < box.top + 40 || row.bottom > box.bottom - 40)
    byId("tree").scrollTop += row.top - box.top - box.height / 2;
  const name = current.querySelector(".name").getBoundingClientRect();
  if (row.left < box.left || name.right > box.right || name.left > box.left + box.width / 2)
    byId("tree").scrollLeft += row.left - box.left - 24;
}

function setFollow(on) {
  follow = on;
  byId("follow").setAttribute("aria-pressed", on);
  if (on) goToTip();
}

function focus(one) {
  for (const other of document.querySelectorAll("[role=treeitem][tabindex='0']")) other.tabIndex = -1;
  one.tabIndex = 0;
  one.focus({preventScroll: true});
  one.firstChild.scrollIntoView({block: "nearest"});
}

// the keys of the ARIA tree pattern
function key(event) {
  const one = event.target.closest("[role=treeitem]");
  if (!one) return;
  const shown = items.filter(other => other.offsetParent !== null);
  const place = shown.indexOf(one);
  const moves = {
    ArrowDown: () => shown[place + 1], ArrowUp: () => shown[place - 1], Home: () => shown[0],
    End: () => shown[shown.length - 1],
    ArrowRight: () => isOpen(one) ? shown[place + 1] : (fold(one, false), one),
    ArrowLeft: () => isOpen(one) ? (fold(one, true), one) : parentItem(one),
    Enter: () => (fold(one, isOpen(one)), one), " ": () => (fold(one, isOpen(one)), one)};
  if (!(event.key in moves)) return;
  event.preventDefault();
  setFollow(false);
  const next = moves[event.key]();
  if (next) focus(next);
}

// ---------------------------------------------------------------------------------------------------------- the rest

const MOST_ALARMS = 3;  // at the top of the page; all stand below

function showPasses(passes) {
  byId("passes").textContent = passes.text;
  ended = passes.ended;
}

function showHealth(parts) {
  ages = [];
  const ill = parts.filter(part => !part.well);
  byId("alarms").replaceChildren(...ill.slice(0, MOST_ALARMS).map(
    part => element("li", "", "✘ " + part.name + ": " + part.status + (part.consequence ? "; " + part.consequence : ""))));
  if (ill.length > MOST_ALARMS) byId("alarms").append(element("li", "", "and " + (ill.length - MOST_ALARMS) + " more"));
  byId("health").replaceChildren(...parts.map(part => {
    const made = element("li", part.well ? "well" : "ill");
    made.append(element("span", "sign", part.well ? "✔" : "✘"), element("span", "name", part.name));
    if (part.calls)
      made.append(element("span", "calls", part.calls + " calls, " + part.failures + " failed, last " + part.seconds + " s"));
    if (part.age !== null) {
      const age = element("span", "calls");
      ages.push({element: age, since: seconds() - part.age});
      made.append(age);
    }
    if (part.status && !part.well) made.append(element("span", "", part.status + "; " + part.consequence));
    return made;
  }));
}

function showTrouble(lines) {
  byId("trouble").replaceChildren(...lines.slice().reverse().map(line => {
    const made = element("li");
    made.append(element("time", "", line.time), line.text);
    return made;
  }));
  if (!lines.length) byId("trouble").append(element("li", "none", "none so far"));
}

function showBlackboard(entries) {
  byId("blackboard").replaceChildren(...entries.map(entry => {
    const row = element("tr");
    row.append(element("td", "", entry[0]), element("td", "", entry[1]));
    return row;
  }));
}

const SHOW = {mission: showMission, statuses: showStatuses, passes: showPasses, health: showHealth, trouble: showTrouble,
              blackboard: showBlackboard, alive: part => { alive = part; }};

// -------------------------------------------------------------------------------------------------- is it still so?

// what is shown is as old as the last message, whatever it says: the page counts by itself
function showDoubt() {
  const silent = seconds() - heard;
  let text = "", age = null;
  if (ended) text = "The mission has ended: " + ended + ".";
  else if (!hasConnection) [text, age] = ["No connection to the mission; trying again. What is shown may be old.", silent];
  else if (silent >= LATE) [text, age] = ["No message from the mission. What is shown may be old.", silent];
  else if (alive.hangs) [text, age] = ["The controller hangs: its tick thread gives no sign of life.", alive.age + silent];
  const [alert, since] = byId("doubt").children;
  if (alert.textContent !== text) alert.textContent = text;  // read aloud once, not every second
  since.textContent = age === null ? "" : "Since " + age.toFixed(0) + " s.";
  document.body.classList.toggle("stale", age !== null);
  document.body.classList.toggle("ended", ended !== "");
  for (const each of ages) each.element.textContent = "last message " + (seconds() - each.since).toFixed(1) + " s ago";
  if (silent >= RETRY && seconds() - lastTry >= RETRY) connect();
}

function connect() {
  if (source) source.close();
  lastTry = seconds();
  source = new EventSource("events");
  source.onmessage = event => {
    const parts = JSON.parse(event.data);
    heard = seconds();
    hasConnection = true;
    for (const name of Object.keys(SHOW)) if (name in parts) SHOW[name](parts[name]);
    showDoubt();
  };
  source.onerror = () => {
    hasConnection = false;
    showDoubt();
  };
}

byId("tree").addEventListener("keydown", key);
byId("tree").addEventListener("wheel", () => setFollow(false), {passive: true});
byId("tree").addEventListener("touchmove", () => setFollow(false), {passive: true});
byId("follow").addEventListener("click", () => setFollow(!follow));
byId("unfold").addEventListener("click", () => { setFollow(false); items.forEach(one => fold(one, false)); });
byId("fold").addEventListener("click", () => {
  setFollow(false);
  items.forEach(one => fold(one, one.classList.contains("subtree")));
});
connect();
setInterval(showDoubt, 250);
