// bench/main.cpp: times single stages. Real parts come from the folder that LAMINA_MODELS names.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  if (std::getenv("LAMINA_MODELS") == nullptr) {
    std::fprintf(stderr, "lamina_bench: LAMINA_MODELS is not set; nothing that needs a real part is timed\n");
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
