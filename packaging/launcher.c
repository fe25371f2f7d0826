// packaging/launcher.c: starts a program of the portable archive with the C library that the archive carries. It is static.
//
//   DIR/bin/lamina        this launcher, under the name of the program
//   DIR/lib/              libraries, those that are opened late too, and the loader
//   DIR/libexec/lamina    the program
// The loader would look like the program in /proc/self/exe, which may be missing anyway: LAMINA_PROGRAM has the launcher's path.
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/auxv.h>
#include <unistd.h>

static const char kLoader[] = "ld-linux-x86-64.so.2";

static int fail(const char* what, const char* path) {
  fprintf(stderr, "lamina: %s: %s: %s; unpack the archive again\n", path, what, strerror(errno));
  return 70;
}

int main(int count, char** arguments) {
  static char own[PATH_MAX], root[PATH_MAX], loader[PATH_MAX + 64], libraries[PATH_MAX + 8], program[2 * PATH_MAX];
  const char* const name = (const char*)getauxval(AT_EXECFN);
  if (name == NULL || realpath(name, own) == NULL) return fail("cannot be found", name == NULL ? "launcher" : name);
  strcpy(root, own);
  for (int up = 0; up < 2; ++up) {
    char* const slash = strrchr(root, '/');
    if (slash == NULL) return fail("is in no folder bin", own);
    *slash = '\0';
  }
  snprintf(loader, sizeof loader, "%s/lib/%s", root, kLoader);
  snprintf(libraries, sizeof libraries, "%s/lib", root);
  snprintf(program, sizeof program, "%s/libexec/%s", root, strrchr(own, '/') + 1);
  if (access(program, X_OK) != 0) return fail("cannot be started", program);
  char** const words = calloc((size_t)count + 7, sizeof *words);
  if (words == NULL || setenv("LAMINA_PROGRAM", own, 1) != 0) return fail("out of memory", own);
  char** word = words;
  *word++ = loader;
  *word++ = "--library-path";
  *word++ = libraries;
  *word++ = "--argv0";
  *word++ = count > 0 ? arguments[0] : own;
  *word++ = program;
  for (int i = 1; i < count; ++i) *word++ = arguments[i];
  execv(loader, words);
  return fail("cannot be started", loader);
}
