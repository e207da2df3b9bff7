"use strict";
// The list of runs: figures, filters, visits, and two of them side by side.

const CHOICES = ["mission", "robot", "day", "result", "fault"];
const LETTERS = {S: "✔", F: "✘", "-": "■"};
const CONTEXT = 3;    // results before the one at which two visits part
const AGAIN = 5000;   // milliseconds to the next question; while runs are read a tenth
let shown = [];       // the visits in the list
let chosen = [];      // those to be compared
let asked = 0;
let drawn = "";       // the answer that is shown

const plural = (number, one, more) => number + " " + (number === 1 ? one : more);
const nameOf = visit => visit.day + " " + visit.time + ", visitor " + visit.number + (visit.robot ? " of " + visit.robot : "");
const choiceOf = name => byId("choose-" + name);
const sum = counts => Object.values(counts).reduce((all, count) => all + count, 0);

function query(first) {
  const parameters = new URLSearchParams({first});
  for (const name of CHOICES) if (choiceOf(name).value) parameters.set(name, choiceOf(name).value);
  return "runs?" + parameters;
}

async function ask(first = 0) {
  const number = ++asked;
  let wait = AGAIN;
  try {
    const answer = await fetch(query(first));
    if (!answer.ok) throw new Error();
    const text = await answer.text(), found = JSON.parse(text);
    if (number !== asked) return;
    if (found.reading) wait /= 10;
    if (text !== drawn) show(found, first);  // else a reader would lose what has the focus
    drawn = text;
  } catch (error) {
    byId("place").textContent = "the viewer does not answer";
  }
  if (number === asked) setTimeout(() => { if (number === asked && shown.length <= 200) ask(); }, wait);
}

function show(found, first) {
  const counts = found.figures.visits, number = sum(counts);
  put(byId("place"), found.place ? found.place + (found.reading ? ": " + found.reading : "") : "no runs are recorded here (recordDirectory)");
  put(byId("figures"), plural(number, "visit", "visits") + " in " + plural(found.figures.runs, "run", "runs"));
  options("mission", found.missions);
  options("robot", found.robots);
  byId("of-robot").hidden = !found.robots.length;
  options("day", found.all_days);
  options("result", Object.keys(counts));
  options("fault", found.figures.faults.map(each => each.fault));
  showResults(counts, number);
  table("faults", found.figures.faults.map(each => [link("fault", each.fault), each.visits, each.ended || ""]), "none");
  table("nodes", found.figures.nodes.map(each => [breakable(element("span"), each.node), each.outages, long(each.between), each.back === null ? "not yet" : long(each.back), each.longest === null ? "" : long(each.longest)]), "none");
  table("days", found.figures.days.map(each => [link("day", each.day), each.runs, sum(each.visits),
    (each.visits.complete || 0) + (each.visits["complete without steps"] || 0), each.visits["broken off"] || "", Math.floor(100 * each.served) + " %"]), "none");
  byId("runs").replaceChildren(...found.runs.map(runElement));
  shown = first ? shown.concat(found.visits) : found.visits;
  const rows = shown.map(visitElement);
  byId("list").replaceChildren(...(rows.length ? rows : [element("li", "quiet", "no visit")]));
  byId("more").hidden = !found.older;
  put(byId("more"), plural(found.older, "older visit", "older visits"));
  showChosen();
}

const long = seconds => duration(1000 * seconds);

// the choice stays, also where nothing has it at present
function options(name, values) {
  const list = choiceOf(name), known = [...list.options].map(one => one.value), all = list.value && !values.includes(list.value) ? [...values, list.value] : values;
  if (known.slice(1).join("\n") === all.join("\n")) return;
  const value = list.value;
  list.replaceChildren(list.options[0], ...all.map(each => new Option(each, each)));
  list.value = value;
}

function showResults(counts, number) {
  const parts = Object.entries(counts);
  byId("bar").setAttribute("aria-label", parts.map(([result, count]) => count + " " + result).join(", "));
  byId("bar").replaceChildren(...parts.map(([result, count]) => {
    const made = element("span", KINDS[result]);
    made.style.flexGrow = count / number;
    return made;
  }));
  byId("results").replaceChildren(...parts.map(([result, count]) => {
    const made = element("li");
    made.append(sign(result), " ", link("result", result, count + " " + result), element("span", "quiet", KINDS[result] === "d" ? " (the visitor's choice)" : ""));
    return made;
  }));
}

// a text that chooses what has it
function link(name, value, text = value) {
  const made = element("button", "text", text);
  made.type = "button";
  made.setAttribute("aria-pressed", choiceOf(name).value === value);
  made.addEventListener("click", () => {
    choiceOf(name).value = choiceOf(name).value === value ? "" : value;
    ask();
  });
  return made;
}

function table(id, rows, nothing) {
  const body = byId(id).tBodies[0];
  body.replaceChildren(...(rows.length ? rows : [[nothing]]).map(cells => {
    const row = element("tr");
    for (const cell of cells) {
      const made = element("td");
      made.append(cell);
      row.append(made);
    }
    return row;
  }));
}

function runElement(run) {
  const made = element("li"), name = run.day + " " + run.began + " to " + run.ended;
  made.append(run.is_readable ? reportLink(run.name, "", name) : element("span", "", name), " ",
              [run.robot, run.mission, plural(run.visits, "visit", "visits"), run.ending].filter(Boolean).join(", "));
  return made;
}

function reportLink(run, part, text) {
  const made = element("a", "", text);
  made.href = "report/" + run + part;
  return made;
}

function visitElement(visit) {
  const made = element("li"), box = element("input"), key = visit.run + "/" + visit.number, words = element("span", "words");
  box.type = "checkbox";
  box.checked = chosen.some(each => each.key === key);
  box.setAttribute("aria-label", "Compare " + nameOf(visit));
  box.addEventListener("change", () => {
    chosen = chosen.filter(each => each.key !== key);
    if (box.checked) chosen = chosen.concat({key, visit}).slice(-2);
    for (const one of byId("list").querySelectorAll("input")) one.checked = chosen.some(each => each.key === one.dataset.key);
    showChosen();
  });
  box.dataset.key = key;
  words.append(sign(visit.result), " ", reportLink(visit.run, "#v" + visit.number, visit.words || visit.result));
  if (visit.faults.length) words.append(element("span", "why", "met: " + visit.faults.join("; ")));
  made.append(box, element("time", "", visit.day + " " + visit.time), words,
              element("span", "quiet", [visit.robot, visit.mission, "visitor " + visit.number, long(visit.seconds)].filter(Boolean).join(", ")));
  return made;
}

function showChosen() {
  byId("compare").disabled = chosen.length < 2;
  put(byId("chosen"), chosen.length ? chosen.map(each => nameOf(each.visit)).join(" and ") : "choose two visits to see where they part");
}

async function compare() {
  const answer = await fetch("compared/" + chosen.map(each => each.key).join("/"));
  byId("compared").hidden = false;
  if (!answer.ok) {
    put(byId("parts"), await answer.text());
    byId("columns").replaceChildren();
  } else showCompared(await answer.json(), chosen.map(each => nameOf(each.visit)));
  byId("compared-title").focus({preventScroll: true});
  byId("compared").scrollIntoView();
}

function showCompared(found, names) {
  const {first} = found, from = first === null ? 0 : Math.max(0, first - CONTEXT);
  const at = rows => first < rows.length ? rows[first].name + " " + LETTERS[rows[first].letter] : "the end";
  put(byId("parts"), first === null ? "Both took the same way, " + plural(found.one.length, "result", "results") + "." :
    "They part after " + plural(first, "result", "results") + " that are alike: " + at(found.one) + " in one, " + at(found.other) + " in the other.");
  byId("columns").replaceChildren(...[found.one, found.other].map((rows, place) => {
    const column = element("div"), list = element("ol", "rows");
    list.start = from + 1;
    list.append(...rows.slice(from).map((row, number) => {
      const made = element("li", number + from === first ? "parts" : "");
      made.append(element("b", row.letter === "-" ? "h" : row.letter, LETTERS[row.letter]), " ", row.name, row.times > 1 ? " " + row.times + " times" : "",
                  element("span", "quiet", " " + row.seconds + " s"), element("span", "why", row.why));
      made.title = row.path;
      return made;
    }));
    column.append(element("h3", "", names[place]), list);
    return column;
  }));
}

byId("choice").addEventListener("submit", event => event.preventDefault());
for (const name of CHOICES) choiceOf(name).addEventListener("input", () => ask());
byId("more").addEventListener("click", () => ask(shown.length));
byId("compare").addEventListener("click", compare);
ask();
