"""The words that this project replaces by terms of the field, where they stand, and the titles of commits."""
import os
import re
import subprocess
from collections import defaultdict

# In prose, with their forms.
PROSE = """tell tells told telling untold ask asks asked asking unasked wish wishes wished wishing lay lays laid laying
    look looks looked looking seen unseen beside whatever whoever nobody foreign ladder ladders rung rungs doubt doubts doubted doubtful
    doubtless unite unites united uniting sanity""".split()
PHRASES = r"by\s+turns|of\s+which\s+none|(?:is|are)\s+none\s+of|(?:go|goes|going|went|gone)\s+on|(?:hang|hangs|hung|hanging)\s+on"
# Parts of identifiers: those, and these.
NAMES = set(PROSE) | set("""least most place places stretch stretches stretched stretching stand stands standing stood judge judges judged
    judging judgement room rooms roomy care cares joints ways""".split())
# Whole names that tell a tale instead of the thing.
TALES = {"LayerWorkshop", "layer_workshop", "keep_what_is_done", "something_to_keep", "at_work", "AtWork"}
# Terms of the field that contain a counted word.
TERMS = re.compile(r"least_?squares", re.I)
# Names of the standard library and of others.
OTHERS = re.compile(r"^(?:in_place(?:_t|_type|_index)?|u?int_least\d+_t|ZIP_SOURCE_TELL)$")

PROSE_PATTERN = re.compile(r"(?<![\w-])(?:" + "|".join(PROSE) + "|" + PHRASES + r")(?![\w])", re.I)
PARTS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
IDENTIFIER = re.compile(r"(?<![\w.'])[A-Za-z_]\w*|(?<=\.)[A-Za-z_]\w*")
KEY = re.compile(r"^(?:--?)?[A-Za-z_][\w.-]*(?:,--?[\w-]+)?$")  # a literal that is a key, an option or a name
SHELL_NAMES = re.compile(r"(?:^|(?<=[\s;(]))[A-Za-z_]\w*(?==|\(\))|(?<=\$)[A-Za-z_]\w*|(?<=\$\{)[A-Za-z_]\w*|(?<!\w)--[a-z][\w-]*", re.M)
MOST_TITLE = 72  # characters


def counted(name):
    """The counted words in an identifier; `lookup` and `emplace` are other words."""
    if OTHERS.match(name):
        return []
    return [part for part in map(str.lower, PARTS.findall(TERMS.sub("", name))) if part in NAMES] + [tale for tale in TALES if tale in name]


def prose(text):
    return [found.group() for found in PROSE_PATTERN.finditer(re.sub(r"\\[nt]", "  ", text))]


def content(literal):
    """What is between the quotes of a literal."""
    raw = re.match(r'(?:u8|[uUL])?R"([^()\\\s]*)\((.*)\)\1"$', literal, re.S)
    if raw:
        return raw.group(2)
    return re.sub(r"^[a-zA-Z]{0,2}(\"{3}|'{3}|[\"'])|(\"{3}|'{3}|[\"'])$", "", literal)


class Words:
    """Uses by identifier, and where comments, literals and pages have counted words."""

    def __init__(self, sources, pages):
        self.uses = defaultdict(lambda: defaultdict(int))  # identifier: path: uses
        self.comments, self.literals, self.pages = [], [], []  # (where, words, text)
        self._known = {}
        for source in sources:
            self._read(source)
        for page in pages:
            for number, line in enumerate(page.text.split("\n"), 1):
                words = prose(re.sub(r"`[^`]*`", " ", line))
                if words:
                    self.pages.append((f"{page.path}:{number}", words, line.strip()))
        for source in sources:
            folder, name = os.path.split(source.path)
            for part in [os.path.splitext(name)[0], *folder.split("/")]:
                if counted(part):
                    self.uses[part]["file name " + source.path] += 1

    def _count(self, path, name, label=None):
        if name not in self._known:
            self._known[name] = bool(counted(name))
        if self._known[name]:
            self.uses[label or name][path] += 1

    def _read(self, source):
        if source.path == "stages/support/text/key.cpp":
            return  # the names that these words had
        shell = source.text.startswith("#!/bin/")
        for name in (SHELL_NAMES if shell else IDENTIFIER).findall(source.bare):
            self._count(source.path, name)
        for _, text in source.directives:
            for name in IDENTIFIER.findall(text):
                self._count(source.path, name)
        for line, text in source.comments:
            words = prose(text)
            if words:
                self.comments.append((f"{source.path}:{line}", words, " ".join(text.split())))
        for line, literal in source.strings:
            text = content(literal)
            if KEY.match(text):
                self._count(source.path, text, f'"{text}"')
                continue
            words = prose(text)
            if words:
                self.literals.append((f"{source.path}:{line}", words, " ".join(text.split())[:200]))

    def table(self, folders=("",)):
        """(identifier, uses, paths) below the folders, the most used first."""
        rows = []
        for name, paths in self.uses.items():
            taken = {path: uses for path, uses in paths.items() if path.replace("file name ", "").startswith(folders)}
            if taken:
                rows.append((name, sum(taken.values()), sorted(taken)))
        return sorted(rows, key=lambda row: (-row[1], row[0]))


def titles(root):
    """(hash, title) of the commits since the last landing; none if no commit is recorded."""
    try:
        with open(os.path.join(root, ".ci/landed"), encoding="utf-8") as file:
            landed = file.read().split()[0]
    except (OSError, IndexError):
        return []
    done = subprocess.run(["git", "log", "--no-merges", "--format=%h%x09%s", f"{landed}..HEAD"], cwd=root, check=False, encoding="utf-8",
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    return [tuple(line.split("\t", 1)) for line in done.stdout.splitlines()] if done.returncode == 0 else []


def title_faults(title, verbs):
    if len(title) > MOST_TITLE:
        yield f"{len(title)} characters, at most {MOST_TITLE}"
    words = prose(title)
    if words:
        yield "says " + ", ".join(words)
    first = re.match(r"[A-Za-z-]*", title).group()
    if first.lower() not in verbs:
        yield f"does not begin with an imperative ({first}); verbs are in scripts/house/verbs.txt"
