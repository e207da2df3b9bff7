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

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

// ------------------------------------------------------------------------------------------------------------ tree

function item(node, level) {
  const made = element("li", node.subtree ? "subtree" : "");
  made.setAttribute("role", "treeitem");
  made.setAttribute("aria-level", level);
  made.tabIndex = -1;
  made.dataset.uid = node.uid;
  const row = element("div", "row");
  row.title = node.path;
  row.append(element("span", "fold"), element("span", "sign", SIGNS["-"]), element("span", "name", node.name));
  if (node.kind) row.append(element("span", "type", node.kind));
  row.addEventListener("click", () => { focus(made); if (node.children.length) fold(made, isOpen(made)); });
  made.append(row);
  items[node.uid - 1] = made;
  if (node.children.length) {
    const group = element("ul");
    group.setAttribute("role", "group");
    for (const child of node.children) group.append(item(child, level + 1));
    made.append(group);
    made.setAttribute("aria-expanded", node.subtree ? "false" : "true");
  }
  return made;
}

function showMission(mission) {
  byId("mission").textContent = "Mission " + mission.file.split("/").pop().replace(/\.xml$/, "");
  document.title = byId("mission").textContent;
  items = [];
  letters = "";
  opened = new Set();
  byId("tree").replaceChildren(...(mission.tree ? [item(mission.tree, 1)] : []));
  if (items.length) items[0].tabIndex = 0;
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

function showPasses(passes) {
  const last = passes.last[passes.last.length - 1];
  byId("passes").textContent = "visitors: " + passes.count +
    (last ? "; the last: " + last.outcome + " after " + last.seconds.toFixed(0) + " s" : "") +
    (passes.ended ? "; ended: " + passes.ended : "");
}

function showHealth(parts) {
  byId("health").replaceChildren(...parts.map(part => {
    const made = element("li", part.well ? "well" : "ill");
    made.append(element("span", "sign", part.well ? "✔" : "✘"), element("span", "name", part.name));
    if (part.calls)
      made.append(element("span", "calls", part.calls + " calls, " + part.failures + " failed, last " + part.seconds + " s"));
    if (part.age !== null) made.append(element("span", "calls", "last message " + part.age + " s ago"));
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
              blackboard: showBlackboard};

function connect() {
  const source = new EventSource("events");
  source.onopen = () => document.querySelector("header").classList.remove("lost");
  source.onmessage = event => {
    const parts = JSON.parse(event.data);
    for (const name of Object.keys(SHOW)) if (name in parts) SHOW[name](parts[name]);
  };
  source.onerror = () => {
    document.querySelector("header").classList.add("lost");
    byId("now").textContent = "no connection to the mission; trying again…";
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
