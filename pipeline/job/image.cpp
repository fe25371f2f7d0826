#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;

constexpr Word<FillRule> kFillRules[] = {
    {"nonzero", FillRule::kNonzero}, {"positive", FillRule::kPositive}, {"evenodd", FillRule::kEvenOdd}};
constexpr Word<Mirror> kMirrors[] = {{"none", Mirror::kNone}, {"x", Mirror::kX}, {"y", Mirror::kY}, {"xy", Mirror::kXY}};

std::string read_format(std::string_view text, Job& job) {
  if (write::find_image_format(text) == nullptr) {
    std::vector<std::string_view> ids;
    for (const auto& format : write::image_formats()) ids.push_back(format.id);
    return not_one_of(text, ids);
  }
  job.format = text;
  return {};
}

const JobKey kImageKeys[] = {
    {"image", "format", "--format", "FORMAT", "of the layer files", true, read_format, [](const Job& j) { return j.format; },
     Form::kString},
    {"image", "fill", "--fill", "RULE",
     "what is solid where shells overlap: nonzero (any), positive (drops shells turned inside out), evenodd", true,
     [](Text t, Job& j) { return read_word(kFillRules, t, j.fill_rule); },
     [](const Job& j) { return write_word(kFillRules, j.fill_rule); }, Form::kString},
    {"image", "mirror", "--mirror", "x|y|xy|none", "turn the image over: x swaps left and right, y back and front", true,
     [](Text t, Job& j) { return read_word(kMirrors, t, j.mirror); },
     [](const Job& j) { return write_word(kMirrors, j.mirror); }, Form::kString},
};

}  // namespace

std::span<const JobKey> image_keys() { return kImageKeys; }

}  // namespace lamina::pipeline
