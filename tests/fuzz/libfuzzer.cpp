// A program for libFuzzer with all targets, of which a call runs one: fuzz_readers --target=obj FOLDER.
//
//   --list        every target, a line each: name, most bytes, dictionary or -, endings of seeds, sources
//   --seeds=DIR   writes the seeds that the target makes itself
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "tests/fuzz/target.h"

namespace {

const lamina::fuzz::Target* chosen = nullptr;

void list() {
  for (const auto& target : lamina::fuzz::targets()) {
    fmt::print("{}\t{}\t{}\t{}\t{}\n", target.name, target.max_bytes, target.dictionary.empty() ? "-" : target.dictionary,
               target.files.empty() ? "-" : target.files, target.sources);
  }
}

void write_seeds(const std::string& folder) {
  int number = 0;
  for (const std::string& seed : chosen->seeds()) {
    if (!chosen->run(seed)) fmt::print(stderr, "{} refuses its own seed {}\n", chosen->name, number);
    std::ofstream(fmt::format("{}/own-{:02}", folder, number++), std::ios::binary) << seed;
  }
}

}  // namespace

extern "C" {

std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t maximum);

int LLVMFuzzerInitialize(int* count, char*** words) {
  using lamina::fuzz::targets;
  std::string seeds;
  std::string_view wanted;
  for (int i = 1; i < *count; ++i) {
    const std::string_view word = (*words)[i];
    if (word == "--list") return list(), std::exit(0), 0;
    if (word.starts_with("--seeds=")) seeds = word.substr(8);
    if (word.starts_with("--target=")) wanted = word.substr(9);
  }
  for (const auto& target : targets()) {
    if (target.name == wanted) chosen = &target;
  }
  if (chosen == nullptr) {
    std::fprintf(stderr, "name a target with --target=NAME; --list lists them\n");
    std::exit(2);
  }
  lamina::fuzz::use_one_thread();
  if (!seeds.empty()) return write_seeds(seeds), std::exit(0), 0;
  return 0;
}

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  run_target(*chosen, {reinterpret_cast<const char*>(data), size});
  return 0;
}

std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t maximum, unsigned seed) {
  if (chosen->mutate == nullptr) return LLVMFuzzerMutate(data, size, maximum);
  // Most mutations know the format; the others are those that know nothing.
  if (seed % 8 != 0) return chosen->mutate(data, LLVMFuzzerMutate(data, size, maximum), maximum, seed / 8);
  return LLVMFuzzerMutate(data, size, maximum);
}
}
