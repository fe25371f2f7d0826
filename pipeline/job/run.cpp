// Sections [load] and [run].
#include "pipeline/job/keys.h"

namespace lamina::pipeline {
namespace {

constexpr Word<Engine> kEngines[] = {{"rays", Engine::kRays}, {"contours", Engine::kContours}, {"both", Engine::kBoth}};

using Pair = std::optional<std::array<std::uint32_t, 2>>;

std::string write_bytes(const std::uint64_t& bytes) {
  for (const auto& [letter, shift] : {std::pair{"G", 30}, {"M", 20}, {"K", 10}}) {
    if (bytes % (1ull << shift) == 0) return fmt::format("{}{}", bytes >> shift, letter);
  }
  return fmt::format("{}", bytes);
}

template <std::string (*Read)(std::string_view, std::array<std::uint32_t, 2>&)>
std::string read_pair(std::string_view text, Pair& pair) {
  std::array<std::uint32_t, 2> read{};
  auto wrong = Read(text, read);
  if (wrong.empty()) pair = read;
  return wrong;
}
std::string write_layers(const Pair& layers) {
  if (!layers) return {};
  const auto [first, last] = *layers;
  return last == UINT32_MAX ? fmt::format("{}:", first) : fmt::format("{}:{}", first, last);
}

std::string write_share(const Pair& share) {
  return share ? fmt::format("{}/{}", (*share)[0] + 1, (*share)[1]) : std::string();
}

const JobKey kLoadKeys[] = {
    field<&Job::repair>(
        {"load", "repair", "--no-repair", "", "plan open meshes as they are instead of closing them", decides::all, "false"}),
    field<&Job::drop_bad>({"load", "drop_bad", "--drop-bad", "",
                           "drop facets with coordinates that are no numbers instead of refusing the file", decides::all,
                           "true"}),
    field<&Job::weld_um>({"load", "weld_um", "--weld", "UM",
                          "repair joins open edges that are at most this far apart, in micrometres", decides::all},
                         {0, 1e6, " um"}),
};

const JobKey kRunKeys[] = {
    text<check_path, &Job::output>({"run", "output", "-o,--output", "DIR", "directory for the layers and the manifest"}),
    word<kEngines, &Job::engine>(
        {"run", "engine", "--engine", "ENGINE", "rays, contours, or both to compare them; all give the same bytes"}),
    field<&Job::threads>({"run", "threads", "--threads", "N", "0 for all that the machine has"}, {0, 4096}),
    custom<Job, read_bytes, write_bytes, &Job::memory_bytes>(
        {"run", "memory", "--memory", "SIZE", "what the layers in flight may hold beside the mesh: 256M, 1G"}, Form::kString),
    custom<Job, read_pair<read_layer_range>, write_layers, &Job::layers>(
        {"run", "layers", "--layers", "A:B", "only layers A to B - 1, counted from 0 at the bottom; A: and :B are open"},
        Form::kString),
    custom<Job, read_pair<read_shard>, write_share, &Job::shard>(
        {"run", "shard", "--shard", "I/N", "only the I-th of N equal shares of the layers, I from 1; see lamina merge"},
        Form::kString),
};

}  // namespace

std::span<const JobKey> load_keys() { return kLoadKeys; }
std::span<const JobKey> run_keys() { return kRunKeys; }

}  // namespace lamina::pipeline
