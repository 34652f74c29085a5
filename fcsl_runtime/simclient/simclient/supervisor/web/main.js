// SPDX-License-Identifier: Apache-2.0
// The page: one stream of the supervisor, from which everything that moves is shown.

import { Refused, events, useToken } from "./api.js";
import { RunView } from "./run_view.js";
import { RunTable, startForm } from "./runs.js";

const RETRY_MS = 1000, SILENT_MS = 10000, SETTLE_MS = 50;

const $ = (id) => document.getElementById(id);
const table = new RunTable($("rows"), showError);
const view = new RunView(restart, showError);
let stream = new AbortController();
let settling = 0;

function showError(error) {
  $("error").hidden = error === null;
  $("error").textContent = error === null ? "" : error.message;
}

function showLink(text, live) {
  $("link").textContent = text;
  $("link").classList.toggle("live", live);
}

/** Returns when a token was given, right or wrong. */
function askForToken() {
  $("unlock").hidden = false;
  $("token").focus();
  return new Promise((done) => ($("unlock").onsubmit = (event) => {
    event.preventDefault();
    useToken($("token").value.trim());
    $("token").value = "";
    $("unlock").hidden = true;
    done();
  }));
}

/** Begins the stream anew, after some quiet: several choices make one request. */
function restart() {
  clearTimeout(settling);
  settling = setTimeout(() => stream.abort(), SETTLE_MS);
}

function receive(name, data) {
  if (name === "runs") {
    table.show(data, view.id);
    const shown = data.find((run) => run.id === view.id);
    if (shown) view.summary(shown);
    $("starting").open ||= data.length === 0;
  } else if (name === "values") {
    view.update(data);
  } else if (name === "error") {
    showError(new Error(data.hint ? `${data.message} (${data.hint})` : data.message));
  }
}

/** Reads one stream until it ends, breaks or is silent. */
async function read() {
  stream = new AbortController();
  const { signal } = stream;
  const silent = () => {
    showLink("no answer; trying again", false);
    stream.abort();
  };
  let silence = setTimeout(silent, SILENT_MS);
  try {
    for await (const [name, data] of events(view.path, signal)) {
      if (signal.aborted) return;
      clearTimeout(silence);
      silence = setTimeout(silent, SILENT_MS);
      showLink("live", true);
      receive(name, data);
    }
    throw new Error("the stream ended");
  } finally {
    clearTimeout(silence);
  }
}

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

async function watch() {
  for (;;) {
    try {
      await read();
    } catch (error) {
      if (stream.signal.aborted) continue;
      showLink(error instanceof Refused ? error.message : "no connection; trying again", false);
      if (error instanceof Refused && error.status === 401) {
        await askForToken();
        follow();
      } else if (error instanceof Refused && error.status === 404) {
        showError(error);
        view.open(null);
      } else {
        await pause(RETRY_MS);
      }
    }
  }
}

function follow() {
  const id = location.hash.slice(1);
  showError(null);
  view.open(id === "" ? null : id);
}

startForm($("start"), (run) => {
  $("starting").open = false;
  location.hash = run.id;
}, showError);
window.addEventListener("hashchange", follow);
follow();
watch();
