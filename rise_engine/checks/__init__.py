"""The checks of a study before and after each session (docs/how-to/check-before-a-session.md).

    for pending in pending_checks(study, "before", read_log(folder), now):
        outcome = kept_check(pending) if pending.good_since else await run_check(pending.check, context)
        if outcome.result == "asked":
            outcome = answer_check(outcome, yes=ask_somebody(outcome.question))

Consoles and commands only show and ask. This package defines what checks do and what their results mean.
"""
