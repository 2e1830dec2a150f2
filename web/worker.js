// The thread in which the drive runs.

import { Board } from "./board.js";

const TURN_MS = 10;
let board = null;
let refused = "";

function begin({ module, tables, bytes, setup, kept }) {
  try {
    board = new Board(module, tables, bytes, setup, kept, (message) => postMessage(message));
  } catch (error) {
    refused = error.message;
    return;
  }
  setInterval(() => board.turn(performance.now()), TURN_MS);
}

onmessage = ({ data: { begin: given, id, path, body } }) => {
  if (given) {
    begin(given);
    return;
  }
  try {
    if (!board) throw new Error(refused);
    postMessage({ id, answer: board.ask(path, body) });
  } catch (error) {
    postMessage({ id, error: error.message });
  }
};
