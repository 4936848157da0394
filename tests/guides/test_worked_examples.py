"""What stands inside of a room is a worked example; to have one tried, write it there."""

import pytest
from guide_pages.pages import EXAMPLES
from guide_pages.worked_example import work_through

EXAMPLE = """
```python
# greeting/words.py
WORD = "hello"
```
Text, and a picture:
```
  nothing to run --> here
```
```bash
cat > runs/a.yaml <<'END'
robot: {name: R7}
END
```
```python
from pathlib import Path
from greeting.words import WORD
from koopman_lab.config.load import load_config
print(WORD, load_config(Path("runs/a.yaml")).robot.name)
```
```bash
klab model --help
```
"""


PRINTS = {EXAMPLE: ("hello R7\n", "Look into model files")}
TEXTS = {
    "of this test": EXAMPLE,
    **EXAMPLES,
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_each_block_does_its_job_on_what_those_before_it_left(text, tmp_path, bus_url):
    printed = work_through(text, tmp_path / "person", LCM_DEFAULT_URL=bus_url)
    for words in PRINTS.get(text, ()):
        assert words in printed


@pytest.mark.parametrize("block", ["bash\nfalse\n", "python\n1 / 0\n", "yaml\na: 1\n"])
def test_a_block_that_fails_or_that_nothing_tries_is_said(block, tmp_path):
    with pytest.raises(AssertionError, match=block.partition("\n")[2].strip()):
        work_through(f"```{block}```\n", tmp_path / "person")
