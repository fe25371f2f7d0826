"""A file of the tree, cut into code, comments and literals."""
import os
import re
import subprocess

CODE = (".h", ".cpp")
PAGE_CODE = (".js", ".css", ".html")
TOKEN = re.compile(r"""
    (?P<comment> //[^\n]*(?:\\\n[^\n]*)* | /\*.*?\*/ )
  | (?P<raw> (?:u8|[uUL])?R"(?P<mark>[^()\\\s]*)\(.*?\)(?P=mark)" )
  | (?P<string> "(?:\\.|[^"\\\n])*" )
  | (?P<char> '(?:\\.|[^'\\\n])+' )
  | (?P<directive> (?<![^\n]) [ \t]*\#(?:\\\n|[^\n])* )
  | (?P<other> [A-Za-z_]\w* | \d(?:[\w.]|'(?=\w))* )
""", re.S | re.X)
HASH_COMMENTS = re.compile(r"""
    (?P<string> [rbf]{0,2}(?:\"{3}.*?\"{3} | '{3}.*?'{3} | "(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])*') )
  | (?P<comment> (?<![^\s;]) \#[^\n]* )
""", re.S | re.X)
WEB = re.compile(r"""(?P<comment> (?<![:"'\w]) //[^\n]* | /\*.*?\*/ | <!--.*?--> ) | (?P<string> "(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])*' )""",
                 re.S | re.X)


class Source:
    """A file, its comments and literals, and its text with those and directives blanked; lines stay where they are."""

    def __init__(self, root, path):
        self.path = path
        with open(os.path.join(root, path), encoding="utf-8", errors="replace") as file:
            self.text = file.read()
        self.lines = self.text.count("\n")
        self.strings, self.includes, self.comments, self.directives = [], [], [], []  # (line, content)
        self.bare, self.code = "", ""  # without literals; with them
        name = os.path.basename(path)
        if path.endswith(CODE):
            self._lex(TOKEN)
        elif path.endswith((".py", ".cmake", ".toml")) or name == "CMakeLists.txt" or self.text.startswith("#!"):
            self._lex(HASH_COMMENTS)
        elif path.endswith(PAGE_CODE):
            self._lex(WEB)

    def line(self, position):
        return self.text.count("\n", 0, position) + 1

    def _lex(self, pattern):
        bare, code, end, line, counted = [], [], 0, 1, 0
        for found in pattern.finditer(self.text):
            kind = found.lastgroup if found.lastgroup != "mark" else "raw"
            if kind == "other":
                continue
            token, start = found.group(), found.start()
            between = self.text[end:start]
            blank = re.sub(r"[^\n]", " ", token)
            bare += [between, blank]
            code += [between, blank if kind == "comment" else token]
            end = found.end()
            line += self.text.count("\n", counted, start)
            counted = start
            if kind in ("raw", "string"):
                self.strings.append((line, token))
            elif kind == "comment":
                self.comments.append((line, token))
            elif kind == "directive":
                name = re.match(r'\s*#\s*include\s*["<]([^">]+)[">]', token)
                if name:
                    self.includes.append((line, name.group(1)))
                else:
                    self.directives.append((line, token))
        self.bare, self.code = "".join(bare) + self.text[end:], "".join(code) + self.text[end:]

    def functions(self):
        """(first line, last line, head, where head and body begin and the body ends) of every function; lambdas and classes in it count to it."""
        start, parentheses, skip = 0, 0, -1
        for found in re.finditer(r"[{}();]", self.bare):
            position, mark = found.start(), found.group()
            if position < skip:
                continue
            if mark in "()":
                parentheses += 1 if mark == "(" else -1
            elif mark == "{" and parentheses > 0:
                skip = closing(self.bare, position)  # an argument's default
            elif mark == "{":
                head = self.bare[start:position]
                if opens_scope(head):
                    start = position + 1
                    continue
                skip = closing(self.bare, position)
                if "(" in head and re.match(r"\s*[,{]", self.bare[skip:]):
                    continue  # a constructor's member: x_{y}, or its body follows
                if re.search(r"\[[^\[\]]*\]\s*(\([^()]*\))?\s*(mutable|noexcept)?\s*(->[^{}]*)?$", head) and "=" in head:
                    yield self.line(position), self.line(skip - 1), " ".join(head.split()), start, position, skip  # a lambda that is kept
                elif "(" in head and not head.rstrip().endswith("="):
                    head = re.sub(r"^\s*(?:(?:public|private|protected)\s*:\s*)*", "", head)
                    yield self.line(position - len(head)), self.line(skip - 1), " ".join(head.split()), start, position, skip
                start = skip
            elif mark == "}" or parentheses == 0:
                start = position + 1

    def types(self):
        """(line, name, what it names) of every struct, class, union and enum outside of functions, and of aliases at namespace scope.
        For an alias the last entry is the type that it names, else None. Specialisations of templates, and
        definitions of what a class declares (A::B), declare no name."""
        scopes, start = [], 0
        for found in re.finditer(r"[{};]", self.bare):
            head, mark = self.bare[start:found.start()], found.group()
            if mark == ";" and set(scopes) <= {"namespace"}:
                alias = ALIAS.match(head)
                if alias:
                    yield self.line(start + alias.start(1)), alias.group(1), " ".join(alias.group(2).split())
            elif mark == "{":
                declared = DECLARED.search(head)
                if re.search(r"\bnamespace\b", head):
                    scopes.append("namespace")
                elif declared and "(" not in re.sub(r"alignas\s*\([^)]*\)", "", head):
                    if "function" not in scopes and "::" not in declared.group(1):
                        yield self.line(start + declared.start(1)), declared.group(1), None
                    scopes.append("type")
                else:
                    scopes.append("function")
            elif mark == "}" and scopes:
                scopes.pop()
            start = found.end()


DECLARED = re.compile(r"\b(?:struct|class|union|enum(?:\s+(?:class|struct))?)\s+(?:alignas\s*\([^)]*\)\s*|\[\[[^\]]*\]\]\s*)*"
                      r"((?:\w+::)*[A-Za-z_]\w*)(?:\s+final)?\s*(?::(?!:)[^;{}]*)?$", re.S)
ALIAS = re.compile(r"\s*(?:template\s*<.*>\s*)?using\s+(\w+)\s*=\s*(.*)$", re.S)


def closing(text, position):
    """Where the brace at `position` is closed, one behind."""
    depth = 0
    for found in re.compile(r"[{}]").finditer(text, position):
        depth += 1 if found.group() == "{" else -1
        if depth == 0:
            return found.end()
    return len(text)


def opens_scope(head):
    head = re.sub(r"alignas\s*\([^)]*\)|\[\[[^\]]*\]\]", " ", head)
    if re.search(r"\bnamespace\b|\bextern\s*$", head):
        return True
    return "(" not in head and not head.rstrip().endswith("=") and bool(re.search(r"\b(class|struct|union|enum)\b", head))


def load(root, folders, endings, also=lambda path: False):
    """The sources below the folders whose names end so, or that `also` takes; files that git ignores are left out."""
    names = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *folders], cwd=root, check=True,
                           stdout=subprocess.PIPE).stdout.decode().split("\0")
    return [Source(root, name) for name in sorted(set(names))
            if (name.endswith(endings) or also(name)) and os.path.isfile(os.path.join(root, name))]
