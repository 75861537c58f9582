// SPDX-License-Identifier: BSD-3-Clause
// The events' picture: as it comes from a live tracker, or one of those that the server makes of a recorded run.

const root = document.documentElement;
const canvas = document.getElementById("picture");
const words = document.getElementById("picture-words");
const MATCHED = "rgb(90 255 130)", OTHER = "rgb(150 156 166)";

/** The format is that of picture.h. */
export function showPicture(buffer) {
  const head = new DataView(buffer);
  const width = head.getUint32(0, true), height = head.getUint32(4, true), points = head.getUint32(8, true);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  paintEvents(image.data, new Uint8Array(buffer, 16, width * height));
  context.putImageData(image, 0, 0);
  const list = new Float32Array(buffer, Math.ceil((16 + width * height) / 4) * 4, 3 * points);
  const matched = paintPoints(context, list);
  words.textContent = points > 0 ? `${matched} of ${points} map points matched` : "no pose yet";
  root.dataset.pictures = 1 + Number(root.dataset.pictures ?? 0);
  root.dataset.matched = matched;
  root.dataset.pictured = head.getFloat32(12, true);
}

function paintEvents(pixels, shades) {
  for (let i = 0; i < shades.length; ++i) {
    const value = shades[i] - 128, share = Math.abs(value) / 127;
    const faded = 0.62 * share; // so that the map stands out
    pixels[4 * i] = value > 0 ? 16 + 230 * faded : 16 + 50 * faded;
    pixels[4 * i + 1] = 20 + 75 * faded;
    pixels[4 * i + 2] = value < 0 ? 26 + 225 * faded : 26 + 50 * faded;
    pixels[4 * i + 3] = 255;
  }
}

/** Those that are matched lie on top. Gives how many they are. */
function paintPoints(context, list) {
  let count = 0;
  for (const matched of [0, 1]) {
    context.fillStyle = matched ? MATCHED : OTHER;
    for (let i = 0; i < list.length; i += 3) {
      if (list[i + 2] !== matched) continue;
      context.fillRect(Math.round(list[i]), Math.round(list[i + 1]), 1, 1);
      count += matched;
    }
  }
  return count;
}

/** The pictures of a recorded run, asked for one at a time as the time moves. */
export class RecordedPictures {
  #times = [];
  #made = 0;
  #shown = -1;
  #wanted = 0;
  #busy = false;

  /** Until all are made; `failed` is told why if they cannot be. */
  async follow(failed) {
    for (;;) {
      const { t, made, fault } = await (await fetch("pictures.json")).json();
      [this.#times, this.#made] = [t, made];
      this.#fetch();
      if (fault) return failed(fault);
      if (made === t.length) return;
      await new Promise((done) => setTimeout(done, 400));
    }
  }

  show(t) {
    this.#wanted = t;
    this.#fetch();
  }

  /** The last picture that is not after the wanted time. */
  #index() {
    let i = this.#times.findLastIndex((t) => t <= this.#wanted + 1e-6);
    return Math.min(Math.max(i, 0), this.#made - 1);
  }

  async #fetch() {
    if (this.#busy) return;
    this.#busy = true;
    for (let i = this.#index(); i >= 0 && i !== this.#shown; i = this.#index()) {
      showPicture(await (await fetch(`picture/${i}`)).arrayBuffer());
      this.#shown = i;
    }
    this.#busy = false;
  }
}
