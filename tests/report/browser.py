#!/usr/bin/env python3
"""tests/report/browser.py PAGE LAYER: opens a report in headless Chromium, uses it as a person does, and reports the results.

Speaks the DevTools protocol over pipes (--remote-debugging-pipe: JSON, each message ended by a zero byte), so that only
Python's own library is needed. Prints one JSON object: seconds until the page was loaded and drawn, messages of the
console, the runs of layer LAYER as the page decodes them, and what each interaction changed. Exit code 77: no Chromium.

  --open              only opens the page and decodes the layer, for scripts/bench report
  --screenshot NAME   writes NAME-light.png, NAME-dark.png, NAME-views.png and NAME-phone.png for inspection
"""
import base64
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time


class Browser:
    def __init__(self, program, profile):
        to_browser, self.send_end = os.pipe()
        self.receive_end, from_browser = os.pipe()

        def wire():  # the browser reads from 3 and writes to 4
            a, b = os.dup(to_browser), os.dup(from_browser)
            os.dup2(a, 3)
            os.dup2(b, 4)

        self.process = subprocess.Popen(
            [program, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
             "--disable-extensions", "--disable-background-networking", f"--user-data-dir={profile}",
             "--remote-debugging-pipe", "about:blank"],
            preexec_fn=wire, close_fds=False, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self.rest, self.number, self.session, self.events = b"", 0, None, []

    def message(self):
        while b"\0" not in self.rest:
            got = os.read(self.receive_end, 1 << 20)
            if not got:
                raise RuntimeError("Chromium has gone")
            self.rest += got
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **parameters):
        self.number += 1
        request = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            request["sessionId"] = self.session
        os.write(self.send_end, json.dumps(request).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def wait_for(self, event):
        while True:
            for have in self.events:
                if have.get("method") == event:
                    return
            self.events.append(self.message())

    def value(self, expression):
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def key(self, key):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 and kind == "keyDown" else "")
        self.settle()

    def settle(self):
        self.value("new Promise(done => setTimeout(done, 150))")

    def click(self, identity):
        x, y = self.value(f"(() => {{ const e = document.querySelector({json.dumps(identity)}); e.scrollIntoView({{block: 'center'}});"
                          " const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]; })()")
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        self.settle()

    def screenshot(self, path):
        shot = self.call("Page.captureScreenshot", format="png")
        with open(path, "wb") as file:
            file.write(base64.b64decode(shot["data"]))


# The page's own clock, from the begin of the navigation: when it said that it is ready, and when what it had drawn by then
# was on the screen (the second frame after that).
CLOCK = """new MutationObserver((_, self) => {
  if (!document.documentElement || document.documentElement.dataset.ready !== 'yes') return;
  self.disconnect();
  window.clock = {ready: performance.now()};
  requestAnimationFrame(() => requestAnimationFrame(() => { window.clock.drawn = performance.now(); }));
}).observe(document, {subtree: true, childList: true, attributes: true, attributeFilter: ['data-ready']});"""
CLOCK_READ = """new Promise(done => { const poll = () => {
  if (!window.clock || !window.clock.drawn) { setTimeout(poll, 5); return; }
  const at = performance.getEntriesByType('navigation')[0];
  done({...window.clock, read: at.responseEnd, parsed: at.domContentLoadedEventEnd, loaded: at.loadEventEnd, start: at.startTime,
        layer: +document.documentElement.dataset.layer});
}; poll(); })"""
STATE = "(() => { const s = laminaReport.state; return {layer: +document.documentElement.dataset.layer, scale: s.scale, x: s.x, y: s.y}; })()"


def messages(browser):
    return [event["params"] for event in browser.events
            if event.get("method") in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded")]


def requests(browser):
    urls = [event["params"]["request"]["url"] for event in browser.events if event.get("method") == "Network.requestWillBeSent"]
    return [url for url in urls if not url.startswith(("file://", "data:", "blob:"))]


def inspection(browser, page, layer, shots, only_open):
    said = {}
    for domain in ("Page", "Runtime", "Log", "Network"):
        browser.call(domain + ".enable")
    browser.call("Emulation.setDeviceMetricsOverride", width=1280, height=900, deviceScaleFactor=1, mobile=False)
    browser.call("Page.addScriptToEvaluateOnNewDocument", source=CLOCK)
    start = time.monotonic()
    browser.call("Page.navigate", url="file://" + os.path.abspath(page))
    browser.wait_for("Page.loadEventFired")
    said["loaded_seconds"] = time.monotonic() - start
    browser.value("laminaReport.ready")
    said["ready_seconds"] = time.monotonic() - start
    said["clock_ms"] = browser.value(CLOCK_READ)
    said["runs"] = browser.value(f"laminaReport.decodeLayer({layer}).then(r => [[...r.rowOffset], [...r.change]])")
    browser.value(f"laminaReport.showLayer({layer})")
    if only_open:
        return said | {"shown": browser.value(STATE)["layer"], "console": messages(browser), "requests": requests(browser)}
    steps = said["steps"] = {"start": browser.value(STATE)}
    if shots:
        browser.screenshot(shots + "-light.png")
    for name, act in (("page_up", lambda: browser.key("PageUp")), ("page_down", lambda: browser.key("PageDown")),
                      ("home", lambda: browser.key("Home")), ("end", lambda: browser.key("End")),
                      ("next_at_end", lambda: browser.click("#next")), ("previous", lambda: browser.click("#previous")),
                      ("closer", lambda: browser.click("#closer")), ("pixels", lambda: browser.click("#pixels")),
                      ("fit", lambda: browser.click("#fit")),
                      ("focus", lambda: browser.value("document.getElementById('view').focus()")),
                      ("arrow_right", lambda: browser.key("ArrowRight")), ("plus", lambda: browser.key("+")),
                      ("zero", lambda: browser.key("0"))):
        act()
        steps[name] = browser.value(STATE)
    x, y = browser.value("(() => { const b = document.getElementById('view').getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]; })()")
    for kind, dx in (("mousePressed", 0), ("mouseMoved", 50), ("mouseReleased", 50)):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x + dx, y=y, button="left", buttons=1, clickCount=1)
    steps["drag"] = browser.value(STATE)
    browser.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=-200)
    browser.settle()
    steps["wheel"] = browser.value(STATE)
    browser.click("#plots canvas")
    steps["plot"] = browser.value(STATE)
    if browser.value("!!document.querySelector('#warnings button')"):
        browser.click("#warnings button")
        steps["warning"] = browser.value(STATE)
        said["warning"] = browser.value("document.querySelector('#warnings button').textContent")
    said["locations"] = browser.value("[...document.querySelectorAll('#locations button')].map(b => b.textContent)")
    if said["locations"]:
        browser.click("#locations li:last-child button")
        steps["position"] = browser.value(STATE)
        # Each frame of the picture in pixels of the image: left, top, right, bottom.
        said["frames"] = browser.value("(() => { const s = laminaReport.state, v = document.getElementById('view'), h = laminaReport.head,"
                                       " r = h.pixel_mm[1] / h.pixel_mm[0];"
                                       " const x = p => s.x + (p - v.width / 2) / s.scale, y = p => s.y + (p - v.height / 2) / (s.scale * r);"
                                       " return s.frames.map(([l, t, w, d]) => [x(l), y(t), x(l + w), y(t + d)]); })()")
    browser.value("document.querySelector('#files').open = true")
    browser.settle()
    # Every picture has the shape of its place: a circle is one. And each plot says what it is.
    said["scaled"] = browser.value("[...document.querySelectorAll('canvas')].map(c => { const b = c.getBoundingClientRect();"
                                      " return (c.width / c.height) / (b.width / b.height); })")
    said["labels"] = browser.value("[...document.querySelectorAll('canvas')].map(c => c.getAttribute('aria-label'))")
    said["file_rows"] = browser.value("document.querySelectorAll('#files tr').length")
    said["text"] = browser.value("document.body.innerText")
    before = browser.value("getComputedStyle(document.body).backgroundColor")
    browser.click("#theme")
    said["grounds"] = [before, browser.value("getComputedStyle(document.body).backgroundColor")]
    browser.value("document.querySelector('#files').open = false; scrollTo(0, 0)")
    if shots:
        browser.screenshot(shots + "-dark.png")
        browser.value("document.getElementById('h-views').scrollIntoView()")
        browser.screenshot(shots + "-views.png")
        browser.value("scrollTo(0, 0)")
    browser.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=2, mobile=True)
    browser.settle()
    said["phone"] = browser.value("[document.documentElement.scrollWidth, innerWidth]")
    if shots:
        browser.screenshot(shots + "-phone.png")
    browser.value(f"laminaReport.showLayer({layer})")
    browser.click("#fit")
    said["ink"] = browser.value("(() => { const v = document.getElementById('view'), d = v.getContext('2d').getImageData(0, 0, v.width, v.height).data;"
                                " const reds = new Set(); for (let i = 0; i < d.length; i += 4) reds.add(d[i]); return reds.size; })()")
    said["console"] = messages(browser)
    said["requests"] = requests(browser)
    return said


def main():
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        print("no chromium in PATH", file=sys.stderr)
        return 77
    shots = sys.argv[sys.argv.index("--screenshot") + 1] if "--screenshot" in sys.argv else None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        try:
            target = browser.call("Target.createTarget", url="about:blank")["targetId"]
            browser.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            json.dump(inspection(browser, sys.argv[1], int(sys.argv[2]), shots, "--open" in sys.argv), sys.stdout)
        finally:
            browser.process.kill()
            browser.process.wait()
    return 0


sys.exit(main())
