"""An interpreter written from `docs/explanation/semantics.md` alone, and what compares it with the kernel.

It is plain and slow on purpose: each file says one section of that page in Python, with no thought for speed. It shares
nothing with the kernel but the words that go in (`inputs.py`) and the scenario itself. Where the two disagree, the page
is read; where the page does not say which of them is right, the page is mended first.
"""
