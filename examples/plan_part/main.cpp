// Plans a part at 300 dpi into files and says how much of each tenth layer is binder.
#include <cstdio>

#include "pipeline/lamina.h"

using namespace lamina::pipeline;

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "usage: plan_part PART DIR\n"), 2;
  Job job;
  job.parts.push_back({.path = argv[1]});
  job.output = argv[2];
  job.bed_mm = {200, 200};
  job.dpi = {300, 300};
  job.layer_mm = 0.1;
  const auto failed = [](const lamina::Error& error) {
    std::fprintf(stderr, "%s\n", error.message.c_str());
    return static_cast<int>(error.fault);
  };
  if (const auto status = check_job(job); !status) return failed(status.error());
  const std::atomic<bool> cancel{false};
  const auto done = run(
      job, lamina::Product::kImages, [](const ProgressEvent&) {}, cancel);
  if (!done) return failed(done.error());
  const auto report = verify(job.output, {});
  if (!report) return failed(report.error());

  // The same layers, without a file.
  const auto source = LayerSource::make(job);
  if (!source) return failed(source.error());
  unsigned long long pixels = 0;
  for (std::uint32_t i = 0; i < source->layer_count(); ++i) {
    const auto images = source->images(i);
    if (!images) return failed(images.error());
    const auto set = static_cast<unsigned long long>(lamina::set_pixels(images->whole));
    pixels += set;
    if (i % 10 == 0) std::printf("layer %u: %llu pixels\n", i, set);
  }
  std::printf("%u layers, %llu pixels, %llu faults\n", done->layers_total, pixels,
              static_cast<unsigned long long>(report->fault_count));
}
