// Lists of batches, and their words.
#include "pipeline/batch/job.h"
#include "stages/load/load.h"
#include "stages/support/text/escape.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

bool read_list(std::string_view text) {
  static MemoryFile file("jobs.txt");
  const auto entries = pipeline::read_batch({file.hold(text)}, {"jet"});
  if (!entries) return check_error(entries.error()), false;
  law(!entries->empty(), "a batch without jobs");
  for (const pipeline::BatchEntry& entry : *entries) {
    const std::vector<std::string> words = entry.words.unpacked();
    law(!words.empty(), "a job without a command");
    law(entry.source.find(":") != std::string::npos, "a job of no line");
    // Quoted again, the words are the same.
    std::string line;
    for (const std::string& word : words) {
      line += line.empty() ? "'" : " '";
      for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
      line += "'";
    }
    const auto again = split_words(line);
    law(again.ok() && *again == words, "words that were quoted are others");
  }
  return true;
}

std::vector<std::string> list_seeds() {
  return {
      "# parts\njet bracket.stl --dpi 600 -o bracket\nlamina extrude 'a part.stl' -o \"out \\\"1\\\".gcode\"\n\nslice x.3mf\r\n"};
}

const Registered kList({"batch_list", read_list, list_seeds, "pipeline/batch/job stages/support/text", ".txt", {}, 1024});

}  // namespace
}  // namespace lamina::fuzz
