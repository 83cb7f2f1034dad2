// Keeps a WebSocket to the server; when it breaks, tries again until it is back.

import { decodeFrame } from "./wire.js";

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 3000;

export class Connection {
  // `on` has greeting(object), frame(object) and state("open" or "lost").
  constructor(on) {
    this.on = on;
    this.wait = FIRST_WAIT_MS;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/frames`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.wait = FIRST_WAIT_MS;
      this.on.state("open");
    };
    this.socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.on.greeting(JSON.parse(data));
      else this.on.frame(decodeFrame(data));
    };
    this.socket.onclose = () => {
      this.on.state("lost");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    };
  }

  ask(request) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }
}
