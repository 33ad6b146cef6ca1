// Runs SCXML documents in SCION, and plays for each of them who carries out its functions (tests/exchange/scxml/scion.py).
//
// Standard input: one JSON document, {"modules": folder of node_modules, "cases": [{"document": text, "steps": [step]}]}.
// A step: {"t": seconds, "timer": whether a countdown of the document is up then, "feed": [event]}; an event: {"name",
// "data", "after": how many functions the document has called in this step before the event comes, "first": whether it
// goes before those that wait}. Standard output: for each case, for each step, what the document did.
'use strict';
const fs = require('fs');
const path = require('path');

const MOST_TRANSITIONS = 5000;
const input = JSON.parse(fs.readFileSync(0, 'utf8'));
const scxml = require(path.join(input.modules, '@scion-scxml', 'scxml'));

class Host {
  constructor(steps) {
    this.steps = steps;
    this.now = 0;
    this.number = 0;
    this.countdowns = [];
    this.queue = [];
    this.feed = [];
    this.calls = 0;
    this.lines = [];
    this.ended = false;
    this.taken = 0;
  }

  // --- what the document asks for ---

  send(event, options) {
    if (options.type === 'x-rise') {
      this.flush(this.calls);
      this.calls += 1;
      this.lines.push(['call', event.name, event.data]);
    } else if (options.delay) {
      this.number += 1;
      this.countdowns.push({id: event.sendid, due: this.now + options.delay / 1000, number: this.number, event});
    } else {
      this.queue.push(event);
    }
  }

  cancel(id) {
    this.countdowns = this.countdowns.filter(countdown => countdown.id !== id);
  }

  // --- what comes from outside ---

  flush(calls) {
    const come = this.feed.filter(event => event.after <= calls);
    this.feed = this.feed.filter(event => event.after > calls);
    this.queue.unshift(...come.filter(event => event.first));
    this.queue.push(...come.filter(event => !event.first));
  }

  drain(interpreter) {
    for (this.flush(this.calls); this.queue.length && !this.ended; this.flush(this.calls)) {
      const event = this.queue.shift();
      interpreter.gen({name: event.name, data: event.data});
    }
    this.queue = [];
  }

  elapse(interpreter, until, at) {
    for (;;) {
      const due = this.countdowns.filter(each => each.due < until - 5e-7 || (at && each.due < until + 5e-7));
      if (!due.length) return;
      due.sort((a, b) => a.due - b.due || a.number - b.number);
      this.now = due[0].due;
      this.countdowns = this.countdowns.filter(each => each !== due[0]);
      this.queue.push(due[0].event);
      this.drain(interpreter);
      if (at) return;
    }
  }

  run(interpreter) {
    interpreter.on('onEntry', id => { if (/^s[0-9]+$/.test(id)) this.lines.push(['enter', id]); });
    interpreter.on('onExitInterpreter', () => { this.ended = true; this.lines.push(['end']); });
    interpreter.on('onTransition', () => {
      this.taken += 1;
      if (this.taken > MOST_TRANSITIONS) throw new Error('this document goes round without end');
    });
    const result = [];
    this.steps.forEach((step, index) => {
      this.taken = 0;
      this.lines = [];
      this.calls = 0;
      this.feed = step.feed;
      this.elapse(interpreter, step.t, false);
      this.now = step.t;
      if (index === 0) interpreter.start();
      if (step.timer) this.elapse(interpreter, step.t, true);
      if (!this.ended) this.drain(interpreter);
      const dues = this.countdowns.map(each => each.due).sort((a, b) => a - b);
      this.lines.push(['pending', this.ended ? [] : dues]);
      result.push(this.lines);
    });
    return result;
  }
}

function toModel(text) {
  return new Promise((resolve, reject) => {
    scxml.documentStringToModel('', text, (error, model) => {
      if (error) return reject(error);
      model.prepare((failed, ready) => failed ? reject(failed) : resolve(ready), {});
    });
  });
}

async function main() {
  const results = [];
  for (const each of input.cases) {
    const host = new Host(each.steps);
    const statechart = scxml.core.Statechart;
    const interpreter = new statechart(await toModel(each.document), {
      customSend: (event, options) => host.send(event, options),
      customCancel: id => host.cancel(id),
    });
    interpreter._scriptingContext.send = (event, options) => host.send(event, options || {});
    try {
      results.push(host.run(interpreter));
    } catch (error) {
      results.push([[['error', String(error.message)]]]);
    }
  }
  process.stdout.write(JSON.stringify(results));
}

main().catch(error => {
  process.stderr.write(String(error && error.stack || error) + '\n');
  process.exit(1);
});
