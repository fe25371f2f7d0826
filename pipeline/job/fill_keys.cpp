// Section [fill]: the keys of one filling (fill_keys.cpp), then what a job adds to them.
#include <array>
#include <utility>

#include "pipeline/job/keys.h"
#include "pipeline/plan/fill.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Text = std::string_view;

template <std::size_t Index>
JobKey job_key() {
  const FillKey& key = fill_settings_keys()[Index];
  return {"fill",
          key.name,
          key.flag,
          key.value,
          key.meaning,
          false,
          [](Text text, Job& job) { return fill_settings_keys()[Index].read(text, job.fill.all); },
          [](const Job& job) { return fill_settings_keys()[Index].write(job.fill.all); },
          key.form};
}

constexpr std::size_t kFillKeys = 20;

template <std::size_t... Index>
std::vector<JobKey> all_keys(std::index_sequence<Index...>) {
  std::vector<JobKey> keys{job_key<Index>()...};
  keys.push_back({"fill", "by_height", "", "RANGES", "other keys between two heights: \"2.7:3 gap_mm=0 angle_deg=90; ...\"",
                  false,
                  [](Text text, Job& job) {
                    FillRequest tried = job.fill;
                    tried.by_height = text;
                    const auto plan = plan_filling(tried, {});
                    if (!plan && plan.error().message.starts_with("fill.by_height: ")) {
                      return plan.error().message.substr(std::string_view("fill.by_height: ").size());
                    }
                    job.fill.by_height = text;
                    return std::string();
                  },
                  [](const Job& job) { return job.fill.by_height; }, KeyForm::kString});
  return keys;
}

}  // namespace

std::span<const JobKey> fill_keys() {
  static const std::vector<JobKey> keys = [] {
    auto all = all_keys(std::make_index_sequence<kFillKeys>());
    if (fill_settings_keys().size() != kFillKeys) std::abort();  // a key was added without its place here
    return all;
  }();
  return keys;
}

}  // namespace lamina::pipeline
