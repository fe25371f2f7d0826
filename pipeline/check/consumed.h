// pipeline/check/consumed.h: deletes the layers of a job as its host receives them.
//
// DIR/consumed.jsonl is a journal (stages/support/io/journal.h) of lines {"job":HEX,"delivered":N,"end":false}: the host has
// the start and the layers [0, N), with "end" the whole program. A line is synced before files of its layers are deleted; the
// last whole line counts. HEX is of manifest.json and of the time at which it was written: a job that was planned again is
// another one, even with equal bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>

#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"
#include "stages/support/io/file.h"
#include "stages/support/io/journal.h"

namespace lamina::pipeline {

struct Delivered {
  std::uint64_t bytes = 0;   // of the output, at the end of what was delivered
  std::uint32_t layers = 0;  // from the first one
  bool start = false, end = false;
  bool earlier = false;  // the record is of an earlier plan, and nothing of this one is delivered
};

/// What is on record of the job in a directory. errors  kOutput: the record cannot be read
Result<Delivered> read_delivered(const std::string& directory);

/// "layers 0 to 41 of 100 were delivered and deleted by lamina stream --consume"
std::string delivered_text(const Delivered& delivered, std::uint32_t layers);

/// Writes a program to a pipe, a stream socket or a serial line, and deletes each layer once all its bytes are taken: read from
/// the pipe or Unix socket, acknowledged by the other side of a TCP connection, passed to the hardware of a serial line. Bytes
/// of other programs in the pipe count as bytes that are not taken.
class Consumption {
 public:
  /// Deletes what a killed run left of delivered layers. The caller has a Claim of the job; all arguments outlive this object.
  /// errors  kUsage: the output does not report what is taken, or the record is of an earlier plan; kOutput
  static Result<Consumption> begin(const std::string& directory, const Manifest& manifest, File& output);
  const Delivered& delivered() const { return delivered_; }

  /// errors  kOutput, also for files that cannot be deleted
  Status write(std::span<const std::byte> bytes);
  /// The bytes so far contain the start and the layers [0, layers), with `end` the whole program. errors  of write()
  Status wrote(std::uint32_t layers, bool end);
  /// Waits until all bytes are taken. errors  of write(); kOutput: the reader ended
  Status finish();

 private:
  Consumption(const std::string& directory, const Manifest& manifest, File& output, Journal journal)
      : directory_(directory), manifest_(manifest), output_(output), journal_(std::move(journal)) {}
  Status settle();
  Status remove();

  const std::string& directory_;
  const Manifest& manifest_;
  File& output_;
  Journal journal_;
  std::string job_;
  unsigned long request_ = 0;  // of ioctl(): bytes that are not taken
  std::uint32_t removed_ = 0;  // layers
  Delivered delivered_;
  std::deque<Delivered> written_;  // not delivered yet
};

}  // namespace lamina::pipeline
