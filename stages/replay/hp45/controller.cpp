#include "stages/replay/hp45/controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

namespace lamina::replay::hp45 {
namespace {

constexpr std::int32_t kBufferSize = 4003;  // Buffer.cpp: BUFFER_SIZE
constexpr std::int32_t kRowGapUm = 4050;    // Position.ino: ROW_GAP
constexpr std::uint32_t kSpeedPulses = 50;  // Position.ino: POSITION_STEP_COUNT
constexpr std::size_t kRawCharacters = 50;  // Serialcom.cpp: serialRaw
constexpr std::size_t kLongestLine = 64;    // Serialcom.cpp: a line with its end
constexpr std::size_t kLongestNumber = 5;   // Serialcom.cpp: digits that 32 bits hold with their sign
constexpr std::int32_t kFullDpi = 600;      // DMAPrint.cpp: SetDPI
// DMAPrint.cpp: seven pairs of nozzles have one address and primitive in the tables; ConvertB6RawToBurst writes the second one
// of a pair over the first, which so never fires: 8 (36), 43 (69), 132 (170), 172 (178), 184 (196), 243 (255), 293 (299).
constexpr std::uint32_t kOverwritten[] = {8, 43, 132, 172, 184, 243, 293};
// What stays as it was until it is told or the controller is switched on anew: how positions are counted, which nozzles, rows
// and bursts fire, how the buffer is read, and what it holds.
constexpr std::string_view kSettings[] = {"SPME", "SER", "SDP", "SDN", "SSID", "BMOD", "BCL"};
constexpr std::uint64_t kEvenBits = 0x5555'5555'5555'5555;  // of a word of a burst: nozzles with even numbers

// Serialcom.cpp: B64Lookup.
int digit_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

bool base64(std::string_view text) {
  return std::ranges::all_of(text, [](char c) { return digit_of(c) >= 0; });
}

void put(Burst& burst, std::uint32_t nozzle) {
  const std::uint32_t location = kCartridgeNozzles - 1 - nozzle;
  burst[location / 64] |= std::uint64_t{1} << (63 - location % 64);
}

// Buffer.cpp: the overlays. Nozzles of odd primitives are the odd ones (NewNozzleTable.ino), side 0 of the buffer. Place 0 of
// a burst is nozzle 299, so that bit 63 of each word is an odd nozzle's.
Burst share(const Burst& burst, std::uint32_t side) {
  static const Burst lost = [] {
    Burst made{};
    for (const std::uint32_t nozzle : kOverwritten) put(made, nozzle);
    return made;
  }();
  Burst shared;
  for (std::size_t w = 0; w < burst.size(); ++w) shared[w] = burst[w] & ~lost[w] & (side == 1 ? kEvenBits : ~kEvenBits);
  return shared;
}

bool nothing(const Burst& burst) {
  return std::ranges::all_of(burst, [](std::uint64_t word) { return word == 0; });
}

Error wrong(std::string what) { return {Fault::kVerification, std::move(what)}; }

}  // namespace

Controller::Controller(double at_um) : burst_(kBufferSize), position_(kBufferSize), at_um_(at_um), zero_um_(at_um) {}

Status Controller::execute(std::string_view command, std::string_view rest) {
  if (command.size() + 1 + rest.size() + 1 > kLongestLine) return wrong("the line is longer than the controller's block");
  const std::size_t blank = rest.find(' ');
  std::string_view small = rest.substr(0, blank);
  const std::string_view raw = blank == std::string_view::npos ? std::string_view() : rest.substr(blank + 1);
  const bool negative = small.starts_with('-');
  if (negative) small.remove_prefix(1);
  if (!base64(small) || !base64(raw)) return wrong("the controller drops the line: a character is not of base 64");
  if (small.size() > kLongestNumber) return wrong("a number that the controller cannot hold");
  if (raw.size() > kRawCharacters) return wrong("more characters than the controller holds");
  std::int32_t value = 0;
  for (const char c : small) value = value * 64 + digit_of(c);
  if (negative) value = -value;
  report(command);
  if (command == "SBR") return add(value, raw);
  if (command == "BCL") {  // BufferClear
    if (unread() > 0) return wrong(fmt::format("{} lines that the head has not come to are cleared", unread()));
    clear_buffer();
    first_ = {true, true};
    update();
    return {};
  }
  if (command == "BRES") {  // BufferReset: the lines are read again
    read_ = {0, 0};
    first_ = {true, true};
    update();
    return {};
  }
  return set(command, value);
}

void Controller::report(std::string_view command) {
  const auto setting = std::ranges::find(kSettings, command == "SDPI" ? "SDP" : command);
  if (setting != std::end(kSettings)) reports_ |= 1u << (setting - std::begin(kSettings));
}

std::string_view Controller::unset() const {
  const auto first = static_cast<std::size_t>(std::countr_one(reports_));
  return first < std::size(kSettings) ? kSettings[first] : std::string_view();
}

Status Controller::set(std::string_view command, std::int32_t value) {
  if (command == "SEP") {
    set_encoder(value);
  } else if (command == "SER") {
    if (value < 1 || value > 25'400) return wrong("an encoder of 1 to 25400 counts an inch");
    counts_per_inch_ = value;
    zeroed_ = false;
    raw_zero_ = raw_;
    zero_um_ = at_um_;
  } else if (command == "SDP" || command == "SDPI") {  // DMAPrint::SetDPI
    if (value < 1 || value > kFullDpi) return wrong("SDP has the nozzles an inch, 1 to 600");
    repeat_ = kFullDpi / value;
  } else if (command == "SDN") {
    density_ = value;
  } else if (command == "SSID") {  // Buffer::SetPrintMode
    if (value < 0 || value > 2) return wrong("SSID has the rows that fire, A to C");
    print_mode_ = value;
  } else if (command == "BMOD") {
    if (value != 0) return wrong("BMOD has to be A: lines are read once");
  } else if (command != "SPME" && command != "BRL") {
    return wrong(fmt::format("'{}' is no command of the dialect", command));
  }
  return {};
}

// DMAPrint::ConvertB6RawToBurst, from the last character on, and Buffer::Add.
Status Controller::add(std::int32_t position, std::string_view raw) {
  if (write_left() <= 0) return wrong(fmt::format("the controller's buffer is full with {} lines: this one is lost", unread()));
  Burst burst{};
  std::uint32_t nozzle = 0;
  for (std::size_t character = raw.size(); character-- > 0;) {
    const int six = digit_of(raw[character]);
    for (int bit = 0; bit < 6; ++bit) {
      for (std::int32_t r = 0; r < repeat_ && nozzle < kCartridgeNozzles; ++r, ++nozzle) {
        if ((six >> bit & 1) != 0) put(burst, nozzle);
      }
    }
  }
  last_ = static_cast<std::uint32_t>(write_);
  burst_[last_] = burst;
  position_[last_] = position;
  write_ = (write_ + 1) % kBufferSize;
  update();
  return {};
}

// Buffer::ClearAll. What the rows have come to (nextState) stays as it is.
void Controller::clear_buffer() {
  std::ranges::fill(burst_, Burst{});
  std::ranges::fill(position_, 0);
  read_ = {0, 0};
  write_ = 1;
}

// Buffer::ReadLeftSide.
std::int32_t Controller::read_left(std::uint32_t side) const { return (kBufferSize + write_ - read_[side]) % kBufferSize - 1; }

// Buffer::WriteLeft in the mode of clearing.
std::int32_t Controller::write_left() const {
  const auto left = [&](std::uint32_t side) { return (kBufferSize - write_ + read_[side]) % kBufferSize - 2; };
  return std::min(left(0), left(1));
}

// PositionSetBaseEncoderPositionMicrons: map() rounds towards zero. The jump counts as a pulse; the head is at rest.
void Controller::set_encoder(std::int32_t position_um) {
  const auto raw = static_cast<std::int32_t>(std::int64_t{position_um} * counts_per_inch_ / 25'400);
  if (raw != raw_) {
    raw_ = raw;
    update_position();
  }
  measures_ = 0;
  raw_zero_ = raw_;
  zero_um_ = at_um_;
  zeroed_ = true;
  update();
}

// PositionUpdate after a new count: micrometres, positions of both rows, and every 50 pulses the direction and the speed.
void Controller::update_position() {
  float um = static_cast<float>(raw_) * 25'400.0f;
  um /= static_cast<float>(counts_per_inch_);
  base_um_ = static_cast<std::int32_t>(um);
  current_[1] = static_cast<std::int32_t>(static_cast<float>(kRowGapUm) / 2.0f + static_cast<float>(base_um_));
  current_[0] = current_[1] - kRowGapUm;
  if (++pulses_ < kSpeedPulses) return;
  pulses_ = 0;
  ++measures_;
  direction_ = (base_um_ > history_um_) - (base_um_ < history_um_);
  history_um_ = base_um_;
}

// UpdateAll, as often as lines can follow each other at one place.
void Controller::update() {
  for (std::int32_t turn = 0; turn < kBufferSize; ++turn) {
    const bool changed = update_values();
    update_burst();
    if (!changed) return;
  }
}

// BufferUpdateValues.
bool Controller::update_values() {
  bool changed = false;
  for (std::uint32_t s = 0; s < 2; ++s) {
    const bool passed = required_[s] == -1 ? current_[s] < target_[s] : current_[s] > target_[s];
    if (first_[s] || passed) changed |= update_side(s);
  }
  return changed;
}

bool Controller::update_side(std::uint32_t s) {
  bool changed = false;
  if (read_left(s) > 0 && !next_state_[s]) {  // Buffer::Next
    next_state_[s] = true;
    read_[s] = (read_[s] + 1) % kBufferSize;
    get_burst();
    changed = true;
  }
  if (read_left(s) > 0 && next_state_[s]) {  // Buffer::LookAheadPosition
    const std::int32_t ahead = position_[static_cast<std::uint32_t>((read_[s] + 1) % kBufferSize)];
    if (first_[s]) {
      target_[s] = current_[s];
      first_[s] = false;
    }
    required_[s] = ahead - target_[s] >= 0 ? 1 : -1;
    min_[s] = std::min(ahead, target_[s]);
    max_[s] = std::max(ahead, target_[s]);
    target_[s] = ahead;
    next_state_[s] = false;
    changed = true;
  }
  if (read_left(0) == 0 && read_left(1) == 0) first_ = {true, true};
  return changed;
}

// InkjetUpdateBurst: which rows fire, and what.
void Controller::update_burst() {
  bool changed = false;
  for (std::uint32_t s = 0; s < 2; ++s) {
    const bool on = required_[s] == direction_ && current_[s] > min_[s] && current_[s] < max_[s] && measures_ > 0;
    changed |= on != active_[s];
    active_[s] = on;  // Buffer::SetActive
  }
  if (changed) get_burst();
}

// Buffer::GetBurst.
void Controller::get_burst() {
  for (std::uint32_t s = 0; s < 2; ++s) {
    const bool on = active_[s] && print_mode_ != (s == 0 ? 2 : 1);
    now_[s] = on ? share(burst_[static_cast<std::uint32_t>(read_[s])], s) : Burst{};
  }
}

void Controller::fire(double from_um, double to_um, const Watch& watch) const {
  for (std::uint32_t s = 0; s < 2; ++s) {
    if (nothing(now_[s])) continue;
    const double row = s == 1 ? kHalfRowGapUm : -kHalfRowGapUm;
    watch({s, static_cast<std::uint32_t>(read_[s]), from_um + row, to_um + row, &now_[s], measures_ > 1});
  }
}

bool Controller::idle() const {
  if (unread() > 0 || !nothing(now_[0]) || !nothing(now_[1])) return false;
  return std::ranges::all_of(read_, [&](std::int32_t line) { return nothing(burst_[static_cast<std::uint32_t>(line)]); });
}

// Whole measures of speed of an idle controller change no state but the count of them; the last two, which set direction and
// history, are walked.
void Controller::skip(std::int64_t last, int direction) {
  constexpr std::int64_t kWalked = 2 * kSpeedPulses;
  const std::int64_t way = direction > 0 ? last - raw_ : raw_ - last;
  if (way < 2 * kWalked || !idle()) return;
  const std::int64_t measures = (way - kWalked) / kSpeedPulses;
  raw_ += static_cast<std::int32_t>(direction * measures * kSpeedPulses);
  measures_ += static_cast<std::uint32_t>(measures);
}

// Lines of the encoder's strip are taken to lie half a count beside the place where SEP was given.
void Controller::move(double to_um, const Watch& watch) {
  const int direction = to_um < at_um_ ? -1 : 1;
  const auto count_at = [&](double um) { return raw_zero_ + std::llround((um - zero_um_) / count_um()); };
  const std::int64_t last = count_at(to_um);
  update();
  skip(last, direction);
  for (double from = at_um_;;) {
    update();
    const bool done = direction > 0 ? raw_ >= last : raw_ <= last;
    const double until = done ? to_um : zero_um_ + (raw_ - raw_zero_ + 0.5 * direction) * count_um();
    fire(from, until, watch);
    if (done) break;
    from = until;
    raw_ += direction;
    update_position();
  }
  at_um_ = to_um;
  measures_ = 0;  // the speed is 0 after POSITION_STEP_TIMEOUT
  update();
}

}  // namespace lamina::replay::hp45
