#include "stages/infill/expression.h"

#include <fmt/format.h>
#include <muParser.h>

#include <cmath>

namespace lamina::infill {

struct Expression::State {
  mu::Parser parser;
  Variables variables;
  std::string text;
};

Expression::Expression() : state_(std::make_unique<State>()) {}
Expression::Expression(Expression&&) noexcept = default;
Expression::~Expression() = default;

Result<Expression> Expression::parse(const std::string& text) {
  Expression expression;
  State& state = *expression.state_;
  state.text = text;
  // muParser would take = for an assignment to a variable; comparisons are left.
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '=') continue;
    const bool comparison = (i > 0 && (text[i - 1] == '=' || text[i - 1] == '<' || text[i - 1] == '>' || text[i - 1] == '!')) ||
                            (i + 1 < text.size() && text[i + 1] == '=');
    if (!comparison) {
      return Error{Fault::kUsage, fmt::format("'{}': = at character {} assigns; write == to compare", text, i + 1)};
    }
  }
  try {
    state.parser.DefineVar("z", &state.variables.z);
    state.parser.DefineVar("h", &state.variables.h);
    state.parser.DefineVar("n", &state.variables.n);
    state.parser.DefineVar("a", &state.variables.a);
    state.parser.DefineVar("i", &state.variables.i);
    state.parser.DefineVar("s", &state.variables.s);
    state.parser.DefineVar("u", &state.variables.u);
    state.parser.SetExpr(text);
    state.parser.Eval();
    if (state.parser.GetNumResults() != 1) {
      return Error{Fault::kUsage, fmt::format("'{}': gives {} numbers; write one formula", text, state.parser.GetNumResults())};
    }
  } catch (const mu::Parser::exception_type& error) {
    std::string why = error.GetMsg();
    while (!why.empty() && (why.back() == '.' || why.back() == ' ')) why.pop_back();
    return Error{Fault::kUsage, fmt::format("'{}': {}; variables are z, h, n, a, i, s and u", text, why)};
  } catch (const std::exception& error) {
    return Error{Fault::kUsage, fmt::format("'{}': {}", text, error.what())};
  }
  return expression;
}

bool Expression::uses(const std::string& variable) const {
  return state_->parser.GetUsedVar().contains(variable);  // it has been parsed once, so nothing is thrown
}

Result<double> Expression::operator()(const Variables& variables) {
  state_->variables = variables;
  double value = 0;
  try {
    value = state_->parser.Eval();
  } catch (const mu::Parser::exception_type& error) {
    return Error{Fault::kUsage, fmt::format("'{}': {}", state_->text, error.GetMsg())};
  }
  if (!std::isfinite(value)) {
    return Error{Fault::kUsage, fmt::format("'{}': is {} where z = {:g}, n = {:g}, i = {:g}, s = {:g}; it has to be a "
                                            "finite number of mm",
                                            state_->text, value, variables.z, variables.n, variables.i, variables.s)};
  }
  return value;
}

}  // namespace lamina::infill
