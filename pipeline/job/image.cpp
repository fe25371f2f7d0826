// Section [image].
#include "pipeline/job/keys.h"
#include "stages/formats/level_format.h"

namespace lamina::pipeline {
namespace {

constexpr Word<FillRule> kFillRules[] = {
    {"nonzero", FillRule::kNonzero}, {"positive", FillRule::kPositive}, {"evenodd", FillRule::kEvenOdd}};
constexpr Word<Mirror> kMirrors[] = {{"none", Mirror::kNone}, {"x", Mirror::kX}, {"y", Mirror::kY}, {"xy", Mirror::kXY}};

std::vector<std::string_view> image_formats() {
  std::vector<std::string_view> ids;
  for (const auto& format : write::image_formats()) ids.push_back(format.id);
  for (const auto& format : write::level_formats()) ids.push_back(format.id);
  return ids;
}

std::string check_image_format(std::string_view text) {
  return !write::extension_of(text) ? not_one_of(text, image_formats()) : std::string();
}

std::string check_title(std::string_view) { return {}; }

const JobKey kImageKeys[] = {
    text<check_image_format, &Job::format>({"image", "format", "--format", "FORMAT", "of the layer files", decides::images})
        .with_words(image_formats),
    word<kFillRules, &Job::fill_rule>(
        {"image", "fill", "--fill-rule", "RULE",
         "what is solid where shells overlap: nonzero (any), positive (drops shells turned inside out), evenodd",
         decides::all}),
    word<kMirrors, &Job::mirror>({"image", "mirror", "--mirror", "x|y|xy|none",
                                  "turn the image over: x swaps left and right, y back and front", decides::images}),
    text<check_title, &Job::title>({"image", "title", "--title", "NAME",
                                    "of the job: TIFF layers then tell it, the layer and z in their tags", decides::images}),
};

}  // namespace

std::string read_fill_rule(std::string_view text, FillRule& rule) { return read_word(kFillRules, text, rule); }
std::span<const JobKey> image_keys() { return kImageKeys; }

}  // namespace lamina::pipeline
