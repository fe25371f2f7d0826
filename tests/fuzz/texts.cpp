// Formulas, and the words, numbers and values of options and files.
#include <cmath>
#include <nlohmann/json.hpp>

#include "stages/heights/candidate_heights.h"
#include "stages/infill/layout.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/toml.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

bool evaluate(std::string_view text) {
  auto formula = infill::Expression::parse(std::string(text));
  if (!formula) return check_line(formula.error().message), false;
  for (const char* name : {"z", "h", "n", "a", "i", "s", "u"}) formula->uses(name);
  for (const double at : {0.0, 0.5, -3.0, 1e9}) {
    const Result<double> value = (*formula)({at, at / 2, at + 1, 90 * at, at, at * at, 1 - at});
    if (value) law(std::isfinite(*value), "a gap that is no number");
    if (!value) check_line(value.error().message);
  }
  return true;
}

/// Each reader of numbers says what is wrong, or gives what is within its range.
void read_numbers(std::string_view text) {
  double number = 0;
  std::int64_t whole = 0;
  std::uint64_t bytes = 0;
  bool on = false;
  std::array<std::uint32_t, 2> two{};
  if (read_number(text, -5, 1e6, " mm", number).empty()) {
    law(number >= -5 && number <= 1e6, "a number out of its range");
    double again = -1;
    law(read_number(number_text(number), -5, 1e6, "", again).empty() && again == number,
        "a number that was written is another");
  }
  if (read_whole(text, -7, 1'000'000'000'000, whole).empty()) law(whole >= -7 && whole <= 1'000'000'000'000, "a whole number");
  read_bytes(text, bytes);
  read_switch(text, on);
  if (read_layer_range(text, two).empty()) law(two[0] < two[1], "a range without layers");
  if (read_shard(text, two).empty()) law(two[0] < two[1], "a shard beyond the last");
}

bool read_texts(std::string_view text) {
  read_numbers(text);
  if (const auto set = heights::read_thicknesses(text)) {
    law(set->size() > 0 && set->minimum() > 0, "no thickness");
    law(std::ranges::adjacent_find(set->values, std::greater_equal{}) == set->values.end(), "thicknesses do not rise");
  }
  if (const auto words = split_words(text)) {
    std::string line;
    for (const std::string& word : *words) {
      line += line.empty() ? "'" : " '";
      for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
      line += "'";
    }
    const auto again = split_words(line);
    law(again.ok() && *again == *words, "words that were quoted are others");
  }
  const auto json = nlohmann::json::parse(json_string(text), nullptr, false);
  law(json.is_string(), "a text is no JSON");
  if (is_utf8(text)) {
    law(json.get<std::string>() == text, "a JSON text is another");
    const auto toml = read_toml_value(toml_string(text));
    law(toml && toml->is_text() && toml->text == text, "a TOML text is another");
  }
  const std::string line = one_line(text);
  law(std::ranges::none_of(line, [](unsigned char c) { return c < 32 || c == 127; }), "a line with control characters");
  return true;
}

bool read_tree(std::string_view text) {
  const auto tree = read_toml(text, "file.toml");
  if (!tree) return check_error(tree.error()), false;
  read_toml_value(text);
  return true;
}

std::vector<std::string> formula_seeds() {
  return {"0.2 + 0.1 * sin(z * _pi)", "h < 0.5 ? max(0.1, u) : 0.3 / (n + 1)", "sqrt(abs(s - 2)) ^ 0.5 + rint(a / 30) * 1e-3"};
}
std::vector<std::string> text_seeds() {
  return {"12.5", "0.05..0.3:0.01", "0.178,0.254", "3:9", "2/5", "1.5GiB", "true", "-o 'a b' \"c\\\"d\" #e", "\xc3\xa9\n\t\\"};
}
std::vector<std::string> tree_seeds() {
  return {"a = 1\nb = [1, 2.5, \"x\"]\n[c.d]\ne = { f = true, g = 1979-05-27T07:32:00Z }\n[[h]]\ni = '''x'''\n"};
}

const Registered kFormula({"formula", evaluate, formula_seeds, "stages/infill/layout", "", "formula.dict", 256});
const Registered kTexts({"texts", read_texts, text_seeds, "stages/support/text stages/heights/candidate_heights", "", {}, 256});
const Registered kTree({"toml", read_tree, tree_seeds, "stages/support/text/toml", ".toml", "toml.dict", 2048});

}  // namespace
}  // namespace lamina::fuzz
