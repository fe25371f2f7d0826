"""Words and sentences of pages in Markdown: without code, tables, headings and the targets of links."""
import re

LONG = 35  # words of a sentence that is too long
MARKUP = re.compile(r"```.*?```|~~~.*?~~~|<!--.*?-->", re.S)
SENTENCE = re.compile(r"(?<=[.!?])[\"')\]*_]*\s+(?=[\"'(\[*_]*[A-Z0-9`\[])|\n\s*\n")
ABBREVIATIONS = re.compile(r"\b(?:e\.g|i\.e|Fig|No|approx|vs|cf|St|et al)\.")


def paragraphs(text):
    """Prose: paragraphs and items of lists, each followed by an empty line."""
    lines = []
    for line in MARKUP.sub("\n", text).split("\n"):
        if re.match(r"\s{4,}\S|\s*\||\s*#|\s*<|\s*!\[|\s*[-=]{3,}\s*$", line) and not re.match(r"\s+(?:[-*]|\d+\.)\s", line):
            lines.append("")
            continue
        item = re.match(r"\s*(?:[-*]|\d+\.)\s+", line)
        lines += ["", line[item.end():]] if item else [line.strip()]
    text = re.sub(r"`[^`\n]*(?:\n[^`\n]+)?`", "code", "\n".join(lines))
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return ABBREVIATIONS.sub(lambda found: found.group().replace(".", ""), text)


def sentences(text):
    """The number of words of each sentence; one without a word of three letters is none."""
    counts = []
    for sentence in SENTENCE.split(paragraphs(text)):
        words = re.findall(r"[^\W_][\w'./%-]*", sentence)
        if len(words) > 2:
            counts.append(len(words))
    return counts


def words(text):
    """Words of a page as `wc -w` counts them, without blocks of code."""
    return len(re.sub(r"^(?: {4,}|\t).*$", "", MARKUP.sub("\n", text), flags=re.M).split())
