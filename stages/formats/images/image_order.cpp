#include "stages/formats/images/image_order.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <numeric>
#include <optional>
#include <string_view>
#include <utility>

#include "stages/support/text/readable.h"

namespace lamina::formats {
namespace {

using Values = std::vector<std::int64_t>;
using Order = std::vector<std::uint32_t>;  // of images, the lowest first

/// Digits of a number before and after a decimal point, so that heights in 10^-9 have 64 bits.
constexpr std::size_t kMaxDigits = 9;

/// The runs of digits of a file's name without its extension.
std::vector<std::string_view> numbers_in(std::string_view stem) {
  constexpr std::string_view kDigits = "0123456789";
  std::vector<std::string_view> numbers;
  for (std::size_t at = stem.find_first_of(kDigits); at != std::string_view::npos;) {
    const std::size_t end = std::min(stem.find_first_not_of(kDigits, at), stem.size());
    numbers.push_back(stem.substr(at, end - at));
    at = stem.find_first_of(kDigits, end);
  }
  return numbers;
}

/// The numbers of a name.
struct NameNumbers {
  Values before;                        // the last one; without those that are too long
  std::optional<std::int64_t> height;  // in 10^-9
  std::size_t digits = 0;               // of it behind the decimal point
  bool minus = false;                   // in front of it
  bool decimal = false;                 // the last one has a decimal point, before which the last of `before` is

  explicit NameNumbers(const std::string& stem) {
    const auto numbers = numbers_in(stem);
    const std::string_view last = numbers.back();
    const auto joined = [&](std::size_t i) {  // to the next number by a decimal point
      return numbers[i].data() + numbers[i].size() + 1 == numbers[i + 1].data() && numbers[i].data()[numbers[i].size()] == '.';
    };
    const std::size_t count = numbers.size();
    decimal = count > 1 && joined(count - 2) && !(count > 2 && joined(count - 3));  // 1.2.3 is no height
    for (const std::string_view number : std::span(numbers).first(count - 1))
      before.push_back(number.size() <= 2 * kMaxDigits ? std::stoll(std::string(number)) : 0);
    const std::string_view whole = decimal ? numbers[count - 2] : last, rest = decimal ? last : std::string_view();
    if (whole.size() > kMaxDigits || rest.size() > kMaxDigits) return;
    height = std::stoll(std::string(whole) + std::string(rest) + std::string(kMaxDigits - rest.size(), '0'));
    digits = rest.size();
    minus = whole.data() != stem.data() && whole.data()[-1] == '-';
  }
};

/// An order of the images by values of theirs.
struct Sorted {
  Order order;
  bool distinct = true;    // no value occurs twice
  std::int64_t step = 0;  // of which all differences are multiples
  bool equal_steps = true;

  explicit Sorted(const Values& values) : order(values.size()) {
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return values[i]; });
    for (std::size_t i = 1; i < order.size(); ++i) {
      const std::int64_t difference = values[order[i]] - values[order[i - 1]];
      distinct = distinct && difference > 0;
      equal_steps = equal_steps && (step == 0 || difference == step);
      step = std::gcd(step, difference);
    }
    equal_steps = equal_steps && distinct;
  }
};

/// Heights a + k b, with whole numbers k from 0, rounded to a unit.
struct RoundedSteps {
  std::vector<std::uint64_t> numbers;  // k, by order
  double step = 0;                     // b

  bool consecutive() const { return numbers.back() + 1 == numbers.size(); }
};

/// Nothing unless the smallest step is some units: of shorter ones every height is a multiple.
std::optional<RoundedSteps> rounded_steps(const Values& heights, const Order& order, std::int64_t unit) {
  constexpr std::int64_t kMinUnits = 3;
  std::int64_t smallest = INT64_MAX;
  for (std::size_t i = 1; i < order.size(); ++i) smallest = std::min(smallest, heights[order[i]] - heights[order[i - 1]]);
  if (order.size() < 2 || smallest < kMinUnits * unit) return std::nullopt;
  RoundedSteps steps{{0}, 0};
  for (std::size_t i = 1; i < order.size(); ++i) {
    const std::int64_t difference = heights[order[i]] - heights[order[i - 1]];
    steps.numbers.push_back(steps.numbers.back() + static_cast<std::uint64_t>((2 * difference + smallest) / (2 * smallest)));
  }
  // The range of h - k b is convex in b, and at most a unit for the right one.
  const auto range = [&](double step) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const double rest = static_cast<double>(heights[order[i]] - heights[order[0]]) - step * static_cast<double>(steps.numbers[i]);
      low = std::min(low, rest);
      high = std::max(high, rest);
    }
    return high - low;
  };
  const auto last = static_cast<double>(steps.numbers.back());
  const double middle = static_cast<double>(heights[order.back()] - heights[order[0]]) / last;
  double low = middle - static_cast<double>(unit) / last, high = middle + static_cast<double>(unit) / last;
  for (int i = 0; i < 60; ++i) {
    const double third = (high - low) / 3;
    if (range(low + third) < range(high - third)) {
      high -= third;
    } else {
      low += third;
    }
  }
  steps.step = (low + high) / 2;
  if (range(steps.step) > static_cast<double>(unit) * (1 + 1e-6)) return std::nullopt;
  return steps;
}

std::string name_of(const Numbered& image) { return one_line(std::filesystem::path(image.path).filename().string()); }

Error two_orders(const std::string& folder, const std::vector<Numbered>& images, const std::string& one, const Order& first,
                 const std::string& other, const Order& second) {
  const auto differ = static_cast<std::size_t>(std::ranges::mismatch(first, second).in1 - first.begin());
  const std::size_t begin = differ < 3 ? 0 : differ - 1;
  const auto names = [&](const Order& order) {
    std::string text = begin > 0 ? "..., " : "";
    for (std::size_t i = begin; i < std::min(begin + 3, order.size()); ++i) text += name_of(images[order[i]]) + ", ";
    return text + "...";
  };
  return {Fault::kInput,
          fmt::format("{}: the names allow two orders: by {} {}; by {} {}; rename the images with one number each",
                      one_line(folder), one, names(first), other, names(second))};
}

/// Multiples of the step, from the first height up, or from 0 if that is below 0.
void number_heights(const Values& heights, const Sorted& sorted, const std::optional<RoundedSteps>& rounded,
                    std::vector<Numbered>& images, ImageSteps& steps) {
  const std::int64_t first = heights[sorted.order[0]];
  steps.step = rounded ? rounded->step : static_cast<double>(sorted.step);
  if (!(steps.step > 0)) return;
  steps.first_number = static_cast<std::uint64_t>(std::llround(std::max(0.0, static_cast<double>(first) / steps.step)));
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto exact = static_cast<std::uint64_t>(sorted.step > 0 ? (heights[sorted.order[i]] - first) / sorted.step : 0);
    images[sorted.order[i]].number = steps.first_number + (rounded ? rounded->numbers[i] : exact);
  }
  const double unit = std::pow(10, -static_cast<double>(kMaxDigits));
  steps.heights = true;
  steps.first = static_cast<double>(first) * unit;
  steps.step *= unit;
}

}  // namespace

std::string ImageSteps::name_of(std::uint64_t number) const {
  if (!heights) return fmt::format("number {}", number);
  return fmt::format("height {:.{}f}", first + static_cast<double>(number - first_number) * step, digits);
}

Result<ImageSteps> sort_images(const std::string& folder, std::vector<Numbered>& images) {
  std::vector<NameNumbers> names;
  Values last, heights;
  bool decimals = false, all_heights = true;
  std::size_t signs = 0, digits = 0;
  std::size_t columns = SIZE_MAX;
  for (const Numbered& image : images) {
    const NameNumbers& name = names.emplace_back(std::filesystem::path(image.path).stem().string());
    last.push_back(image.number);
    heights.push_back(name.height.value_or(0));
    decimals = decimals || name.decimal;
    all_heights = all_heights && name.height.has_value();
    signs += name.minus ? 1 : 0;
    digits = std::max(digits, name.digits);
  }
  const bool below_0 = signs > 0 && signs < names.size() && decimals && all_heights;
  for (std::size_t i = 0; below_0 && i < names.size(); ++i) {
    if (names[i].minus) heights[i] = -heights[i], last[i] = -last[i];
  }
  ImageSteps steps;
  const Sorted by_last(last);
  Order order = by_last.order;
  bool ordered = by_last.distinct, by_height = false;
  bool counted = by_last.equal_steps && by_last.step <= 1;
  if (decimals && all_heights) {
    Sorted sorted(heights);
    const auto unit = static_cast<std::int64_t>(std::llround(std::pow(10, static_cast<double>(kMaxDigits - digits))));
    const auto rounded = sorted.distinct ? rounded_steps(heights, sorted.order, unit) : std::nullopt;
    sorted.equal_steps = sorted.equal_steps || (rounded && rounded->consecutive());
    const bool same = sorted.order == order;
    if (sorted.distinct && ordered && !same && (!sorted.equal_steps || images.size() < 3))
      return two_orders(folder, images, "height", sorted.order, "the last number", order);
    if (sorted.distinct && (below_0 || !(ordered && same && counted && sorted.equal_steps))) {
      order = sorted.order;
      ordered = by_height = true;
      counted = sorted.equal_steps;
      number_heights(heights, sorted, rounded, images, steps);
      steps.digits = static_cast<int>(digits);
    }
  }
  for (const NameNumbers& name : names) columns = std::min(columns, name.before.size() - (by_height && name.decimal ? 1 : 0));
  for (std::size_t column = 0; column < columns && ordered; ++column) {
    Values values;
    for (const NameNumbers& name : names) values.push_back(name.before[column]);
    const Sorted sorted(values);
    if (sorted.distinct && sorted.order != order && (sorted.equal_steps || !counted))
      return two_orders(folder, images, fmt::format("number {} of each", column + 1), sorted.order,
                        by_height ? "height" : "the last number", order);
  }
  std::ranges::sort(images, [](const Numbered& a, const Numbered& b) {
    return a.number != b.number ? a.number < b.number : a.path < b.path;
  });
  return steps;
}

}  // namespace lamina::formats
