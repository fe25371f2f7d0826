// Plans a part at 300 dpi and says how much of each tenth layer is binder.
#include <cstdio>

#include "pipeline/output/manifest.h"
#include "pipeline/run/run.h"

using namespace lamina::pipeline;

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "usage: plan_part PART DIR\n"), 2;
  Job job;
  job.parts.push_back({.path = argv[1]});
  job.output = argv[2];
  job.bed_mm = {200, 200};
  job.dpi = {300, 300};
  job.layer_mm = 0.1;
  if (const auto status = check_job(job); !status) return std::fprintf(stderr, "%s\n", status.error().message.c_str()), 2;
  const std::atomic<bool> cancel{false};
  const auto done = run(
      job, Product::kImages, [](const ProgressEvent&) {}, cancel);
  if (!done) {
    std::fprintf(stderr, "%s\n", done.error().message.c_str());
    return static_cast<int>(done.error().fault);
  }
  const auto manifest = read_manifest(job.output + "/manifest.json");
  if (!manifest) return 5;
  unsigned long long pixels = 0;
  for (const LayerRecord& layer : manifest->layers) pixels += layer.set_pixels;
  for (std::size_t i = 0; i < manifest->layers.size(); i += 10) {
    std::printf("layer %zu: %llu pixels\n", i, static_cast<unsigned long long>(manifest->layers[i].set_pixels));
  }
  std::printf("%u layers, %llu pixels\n", done->layers_total, pixels);
}
