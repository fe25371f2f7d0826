#include "stages/support/text/formula.h"

#include <fmt/format.h>
#include <muParser.h>

#include <algorithm>
#include <vector>

namespace lamina {
namespace {

/// "x, y and z"
std::string listed(std::span<const std::string_view> names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += fmt::format("{}{}", i == 0 ? "" : i + 1 < names.size() ? ", " : " and ", names[i]);
  }
  return text;
}

/// The character from 1 of the first = that is no comparison; 0: there is none.
std::size_t assignment_in(std::string_view text) {
  const auto is = [&](std::size_t i, std::string_view of) { return i < text.size() && of.find(text[i]) != of.npos; };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '=' && !(i > 0 && is(i - 1, "=<>!")) && !is(i + 1, "=")) return i + 1;
  }
  return 0;
}

}  // namespace

struct Formula::State {
  mu::Parser parser;
  std::vector<double> values;
  std::string text;
};

Formula::Formula() : state_(std::make_unique<State>()) {}
Formula::Formula(Formula&&) noexcept = default;
Formula& Formula::operator=(Formula&&) noexcept = default;
Formula::~Formula() = default;

Result<Formula> Formula::parse(const std::string& text, std::span<const std::string_view> names) {
  Formula formula;
  State& state = *formula.state_;
  state.text = text;
  state.values.assign(names.size(), 0);
  // muParser would take = for an assignment to a variable; comparisons are left.
  if (const std::size_t at = assignment_in(text); at > 0) {
    return Error{Fault::kUsage, fmt::format("'{}': = at character {} assigns; write == to compare", text, at)};
  }
  try {
    for (std::size_t i = 0; i < names.size(); ++i) state.parser.DefineVar(std::string(names[i]), &state.values[i]);
    state.parser.SetExpr(text);
    state.parser.Eval();
    if (state.parser.GetNumResults() != 1) {
      return Error{Fault::kUsage, fmt::format("'{}': gives {} numbers; write one formula", text, state.parser.GetNumResults())};
    }
  } catch (const mu::Parser::exception_type& error) {
    std::string why = error.GetMsg();
    while (!why.empty() && (why.back() == '.' || why.back() == ' ')) why.pop_back();
    return Error{Fault::kUsage, fmt::format("'{}': {}; variables are {}", text, why, listed(names))};
  } catch (const std::exception& error) {
    return Error{Fault::kUsage, fmt::format("'{}': {}", text, error.what())};
  }
  return formula;
}

const std::string& Formula::text() const { return state_->text; }

bool Formula::uses(std::string_view name) const {
  return state_->parser.GetUsedVar().contains(std::string(name));  // it has been parsed once, so nothing is thrown
}

Result<double> Formula::operator()(std::span<const double> values) {
  std::ranges::copy(values, state_->values.begin());
  try {
    return state_->parser.Eval();
  } catch (const mu::Parser::exception_type& error) {
    return Error{Fault::kUsage, fmt::format("'{}': {}", state_->text, error.GetMsg())};
  }
}

}  // namespace lamina
