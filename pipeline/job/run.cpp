#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;

constexpr Word<Engine> kEngines[] = {{"rays", Engine::kRays}, {"contours", Engine::kContours}, {"both", Engine::kBoth}};

const JobKey kLoadKeys[] = {
    {"load", "repair", "--no-repair", "", "plan open meshes as they are instead of closing them", true,
     [](Text t, Job& j) { return read_switch(t, j.repair); }, [](const Job& j) { return write_switch(j.repair); }, Form::kBare,
     "false"},
    {"load", "drop_bad", "--drop-bad", "", "drop facets with coordinates that are no numbers instead of refusing the file",
     true, [](Text t, Job& j) { return read_switch(t, j.drop_bad); }, [](const Job& j) { return write_switch(j.drop_bad); },
     Form::kBare, "true"},
    {"load", "weld_um", "--weld", "UM", "repair joins open edges that are at most this far apart, in micrometres", true,
     [](Text t, Job& j) { return read_number(t, 0, 1e6, " um", j.weld_um); },
     [](const Job& j) { return number_text(j.weld_um); }, Form::kBare},
};

const JobKey kRunKeys[] = {
    {"run", "output", "-o,--output", "DIR", "directory for the layers and the manifest", false,
     [](Text t, Job& j) { return read_path(t, j.output); }, [](const Job& j) { return j.output; }, Form::kString},
    {"run", "engine", "--engine", "ENGINE", "rays, contours, or both to compare them; all give the same bytes", false,
     [](Text t, Job& j) { return read_word(kEngines, t, j.engine); },
     [](const Job& j) { return write_word(kEngines, j.engine); }, Form::kString},
    {"run", "threads", "--threads", "N", "0 for all that the machine has", false,
     [](Text t, Job& j) {
       std::int64_t threads = 0;
       auto wrong = read_whole(t, 0, 4096, threads);
       if (wrong.empty()) j.threads = static_cast<std::uint32_t>(threads);
       return wrong;
     },
     [](const Job& j) { return fmt::format("{}", j.threads); }, Form::kBare},
    {"run", "memory", "--memory", "SIZE", "what the layers in flight may hold beside the mesh: 256M, 1G", false,
     [](Text t, Job& j) { return read_bytes(t, j.memory_bytes); },
     [](const Job& j) {
       for (const auto& [letter, shift] : {std::pair{"G", 30}, {"M", 20}, {"K", 10}}) {
         if (j.memory_bytes % (1ull << shift) == 0) return fmt::format("{}{}", j.memory_bytes >> shift, letter);
       }
       return fmt::format("{}", j.memory_bytes);
     },
     Form::kString},
    {"run", "layers", "--layers", "A:B", "only layers A to B - 1, counted from 0 at the bottom; A: and :B are open", false,
     [](Text t, Job& j) {
       std::array<std::uint32_t, 2> range{};
       auto wrong = read_layer_range(t, range);
       if (wrong.empty()) j.layers = range;
       return wrong;
     },
     [](const Job& j) {
       if (!j.layers) return std::string();
       const auto [first, last] = *j.layers;
       return last == UINT32_MAX ? fmt::format("{}:", first) : fmt::format("{}:{}", first, last);
     },
     Form::kString},
    {"run", "shard", "--shard", "I/N", "only the I-th of N equal shares of the layers, I from 1; see lamina merge", false,
     [](Text t, Job& j) {
       std::array<std::uint32_t, 2> shard{};
       auto wrong = read_shard(t, shard);
       if (wrong.empty()) j.shard = shard;
       return wrong;
     },
     [](const Job& j) { return j.shard ? fmt::format("{}/{}", (*j.shard)[0] + 1, (*j.shard)[1]) : std::string(); },
     Form::kString},
};

}  // namespace

std::span<const JobKey> load_keys() { return kLoadKeys; }
std::span<const JobKey> run_keys() { return kRunKeys; }

}  // namespace lamina::pipeline
