"use strict";
// One moment of a run, now or earlier, on page and report: card, robot, stops, transcript, blackboard, and the scrubber.

// the status of a node; small letters: before it went back to idle
const SIGNS = {R: "▶", S: "✔", F: "✘", s: "✔", f: "✘", r: "■", "-": "·", again: "↻"};
const WORDS = {R: "running", S: "success", F: "failure", s: "success earlier in this visit", f: "failure earlier in this visit",
               r: "halted", "-": "not yet ticked", again: "done again after a failure"};

// --------------------------------------------------------------------------------------------------------- what is sent

// what was so at a moment, from a stretch of moments, each with its time and the parts that changed
async function momentAt(at) {
  const parts = {};
  for (const [when, news] of await travels.stretch(at)) if (when <= at || !parts.now) Object.assign(parts, news);
  return parts;
}

// a text that leads to its node, if it has one
function leading(text, uid) {
  const made = uid ? element("a") : document.createDocumentFragment();
  made.append(...quoting(text));
  if (uid) made.href = "#" + NODE + uid;
  return made;
}

function fillTable(id, rows) {
  byId(id).tBodies[0].replaceChildren(...(rows.length ? rows : [["none"]]).map(row => {
    const made = element("tr");
    made.append(...row.map(text => element("td", rows.length ? "" : "quiet", text)));
    return made;
  }));
}

const showBlackboard = entries => fillTable("blackboard", Object.entries(entries).filter(([, text]) => text !== null));

// -------------------------------------------------------------------------------------------------------- which moment

let ahead = 0;       // seconds by which the time of the node's events is ahead of seconds()
let shift = 0;       // seconds from that to the time of day
let frozen = null;   // the moment that is shown, as such a time; null: now
let wanted = null;   // the one to show next
let isAsking = false;
let timeOfDay = at => new Date(1000 * (at + shift)).toTimeString().slice(0, 8);
let travels = null;  // {stretch: returns moments up to one, show: shows these parts, live: shows what is so now, end: of a run that has ended}

function seconds() { return performance.now() / 1000; }

const nodeTime = () => frozen !== null ? frozen : travels.end || seconds() + ahead;

async function travel(at) {
  [frozen, wanted] = [at, at];
  showMoment();
  if (isAsking) return;
  isAsking = true;
  try {
    while (wanted !== null) {
      const asked = wanted;
      wanted = null;
      const parts = await momentAt(asked);
      if (frozen !== null) travels.show(parts);
    }
  } catch (error) {
    // the connection is lost: the foot of the page says so
  } finally {
    isAsking = false;
  }
}

function live() {
  [frozen, wanted] = [null, null];
  showMoment();
  travels.live();
}

function showMoment() {
  const isPast = frozen !== null && frozen !== travels.end;
  byId("live").setAttribute("aria-pressed", !isPast);
  document.body.classList.toggle("past", isPast);
  put(byId("moment"), timeOfDay(nodeTime()));
  byId("scrub").value = nodeTime();
  byId("scrub").setAttribute("aria-valuetext", timeOfDay(nodeTime()));
}

const STRIDES = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -60, PageUp: 60};  // seconds

function listenToScrubber() {
  const scrub = byId("scrub");
  scrub.addEventListener("input", () => travel(Number(scrub.value)));
  scrub.addEventListener("keydown", event => {
    if (!(event.key in STRIDES)) return;
    event.preventDefault();
    travel(Math.min(Math.max(nodeTime() + STRIDES[event.key], scrub.min), scrub.max));
  });
  byId("live").addEventListener("click", live);
  walkByArrows(byId("transcript"), "a, summary");
  addEventListener("resize", () => { showNewest(byId("transcript")); showNewest(byId("stops")); });
  byId("transcript").addEventListener("click", event => {
    const chosen = event.target.closest("time");
    if (chosen) travel(Number(chosen.parentElement.dataset.at));
  });
}

// ------------------------------------------------------------------------------------------------------- card and robot

const STOP_SIGNS = {"under way": "▶", completed: "✔", "left out": "✘", "broken off": "✘", left: "○"};
let visit = null;    // the one under way, or the last one
let card = {kind: "idle", what: "nothing runs", since: null, until: null};
let sentences = [];

function showNow(part) {
  card = part.card;
  const all = [card.what, ...card.also].join("\n");  // one line for each thing at once
  if (byId("now").textContent !== all) byId("now").replaceChildren(...quoting(all));
  byId("now").classList.toggle("several", card.also.length > 0);
  byId("now").title = all;
  byId("card").dataset.kind = card.kind;
  put(byId("waits"), [card.attempt > 1 ? "attempt " + card.attempt + " of " + card.attempts : "",
                      card.waits_for ? "waits for " + card.waits_for : "", card.trouble].filter(Boolean).join(" · "));
  put(byId("next"), card.next ? "next: " + card.next : "");
  showRobot(part.robot);
  showElapsed();
}

// what a person has to do stays until it is done
function showRobot(robot) {
  const texts = {alive: robot.alive, place: robot.place, attention: robot.attention && "attention " + robot.attention,
                 movement: robot.movement && "lifelike movement " + robot.movement, safe: robot.safe, instruction: robot.instruction};
  if (robot.safe) texts.attention = texts.movement = "";  // the safe state says it
  for (const [id, text] of Object.entries(texts)) put(byId(id), text);
  byId("robot").title = byId("robot-state").textContent;  // a long one is cut
  byId("robot").classList.toggle("ill", !robot.is_well);
}

function showStory(story) {
  visit = story.visit;
  sentences = story.sentences;
  put(byId("visitor"), visit ? visitorText() : "No visitor yet");
  const box = byId("transcript"), follows = isAtEnd(box);
  showStops(visit ? visit.stops : []);
  if (follows) showNewest(box);  // the stops take their room from it
  showTranscript(sentences);
}

function visitorText() {
  const current = visit.stops.find(each => each.state === "under way");
  return (visit.arrived === null ? "Pass " : "Visitor ") + visit.number + (current ? " · " + (current.noun || "stop") + " " + current.number + " of " + current.of + ", " + current.name : "");
}

function showElapsed() {
  const since = card.since === null ? null : Math.max(0, nodeTime() - card.since);
  const left = card.until === null ? null : Math.max(0, card.until - nodeTime()).toFixed(0) + " s";
  const limit = card.until === null ? 0 : card.until - card.since;
  let text = "";
  if (card.kind === "ended") text = "at " + timeOfDay(card.since);
  else if (card.kind === "asleep" && left) text = "until " + timeOfDay(card.until) + ", " + left + " more";
  else if (card.kind === "step" && left) text = since.toFixed(0) + " s of at most " + +limit.toFixed(1) + " s";
  else if (since !== null) text = "for " + duration(1000 * since).replace(/\.\d/, "") + (left ? ", at most " + left + " more" : "");
  put(byId("elapsed"), text);
  byId("limit").classList.toggle("none", !limit);
  if (limit) [byId("limit").max, byId("limit").value] = [limit, Math.min(since, limit)];
}

function showStops(stops) {
  byId("stops").replaceChildren(...stops.map(each => {
    const state = each.is_left ? "left" : each.state, made = element("li", state.replace(" ", "-"));
    made.append(element("span", "sign", STOP_SIGNS[state]), " " + each.number + " " + each.name);
    if (each.why) {
      made.append(": " + state);
      made.title = each.why;  // the story tells it
    }
    return made;
  }));
  showNewest(byId("stops"));
}

// what is last in a box comes into view
function showNewest(box) { [box.scrollTop, box.scrollLeft] = [box.scrollHeight, box.scrollWidth]; }
const isAtEnd = box => box.scrollTop + box.clientHeight >= box.scrollHeight - 8;

// what is new comes last, and in view unless the reader has scrolled back; what the board keeps no more goes. Sentences of one
// incident are one entry: its cause, and beneath it what was done about it
function showTranscript(sentences) {
  const box = byId("transcript"), list = box.firstChild;
  const follows = isAtEnd(box) || frozen !== null;
  const known = [...list.querySelectorAll("[data-number]")].sort((one, other) => one.dataset.number - other.dataset.number);
  const last = known[known.length - 1], same = last && sentences.find(each => each.number === Number(last.dataset.number));
  const goesOn = same && same.at === Number(last.dataset.at);  // else it is another moment, or another run
  if (!goesOn) list.replaceChildren();
  for (const each of sentences) if (!goesOn || each.number > same.number) addSentence(list, each);
  if (follows) showNewest(box);
  // after what is new was drawn: together, the two would move the rows by more than the box is scrolled
  setTimeout(dropOld, 100);
}

function dropOld() {
  const box = byId("transcript"), list = box.firstChild, fromEnd = box.scrollHeight - box.scrollTop;
  const oldest = sentences.length ? sentences[0].number : 0;
  for (const one of list.querySelectorAll("[data-number]")) if (Number(one.dataset.number) < oldest) one.remove();
  for (const one of [...list.children]) if (!one.querySelector("[data-number]")) one.remove();
  box.scrollTop = box.scrollHeight - fromEnd;
}

function addSentence(list, row) {
  const known = row.incident && list.querySelector('[data-incident="' + row.incident + '"][data-visit="' + row.visit + '"]');
  if (!known) {
    list.append(entry(row, list.lastChild));
    return;
  }
  let more = known.querySelector("details");
  if (!more) {
    more = element("details");
    more.append(element("summary"), element("ol"));
    more.firstChild.tabIndex = -1;
    known.append(more);
  }
  const item = element("li", row.severity);
  item.append(sentence(row));
  more.lastChild.append(item);
  put(more.firstChild, more.lastChild.childElementCount + " more; last: " + row.text);
}

function entry(row, before) {
  const made = element("li", row.severity);
  if (row.incident) made.dataset.incident = row.incident;
  made.dataset.visit = row.visit;
  if (before && before.dataset.visit !== made.dataset.visit) made.classList.add("begins");
  made.append(sentence(row));
  return made;
}

function sentence(row) {
  const made = element("div", "sentence"), text = element("span");
  made.dataset.number = row.number;
  made.dataset.at = row.at;
  text.append(leading(row.text, row.uid));
  for (const link of text.querySelectorAll("a")) link.tabIndex = -1;
  made.append(element("time", "", row.time), text);
  return made;
}
