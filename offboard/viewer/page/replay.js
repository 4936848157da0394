// The bar that steers a log that is sent again: where it is, on and back, pause.
const get = (id) => document.getElementById(id);
const HELD_MS = 600; // so long after a person moved it the bar does not follow the replay

export class ReplayBar {
  // `send` takes what is asked for, without the robot; `maySteer` says whether this page may ask.
  constructor(send, maySteer) {
    this.send = send;
    this.maySteer = maySteer;
    this.heldUntil = 0;
    this.playing = true;
    get("replay-play").addEventListener("click", () => send({ action: this.playing ? "pause" : "play" }));
    get("replay-at").addEventListener("input", () => {
      this.heldUntil = performance.now() + HELD_MS;
      this.say(get("replay-at").valueAsNumber, Number(get("replay-at").max));
      send({ action: "seek", value: get("replay-at").valueAsNumber });
    });
    get("replay-speed").addEventListener("change", () => send({ action: "speed", value: Number(get("replay-speed").value) }));
  }

  // `progress` is what the snapshot says of the replay, null where none can be steered.
  show(progress) {
    get("replay-bar").hidden = !progress || !this.maySteer();
    if (get("replay-bar").hidden) return;
    this.playing = progress.playing;
    const word = progress.playing ? "Pause" : "Play";
    if (get("replay-play").textContent !== word) get("replay-play").textContent = word;
    const speed = [...get("replay-speed").options].find((option) => Number(option.value) === progress.speed);
    if (document.activeElement !== get("replay-speed")) get("replay-speed").value = speed ? speed.value : "";
    if (performance.now() < this.heldUntil) return;
    const at = get("replay-at");
    at.min = progress.start_s;
    at.max = progress.end_s;
    at.value = progress.position_s;
    this.say(progress.position_s, progress.end_s);
  }

  say(position, end) {
    const line = `${position.toFixed(1)} of ${end.toFixed(1)} s`;
    if (get("replay-time").textContent !== line) get("replay-time").textContent = line;
    get("replay-at").setAttribute("aria-valuetext", line);
  }
}
