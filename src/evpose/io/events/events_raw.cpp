// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_raw.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <variant>

#include "evpose/core/log.h"
#include "evpose/io/events/event_source.h"
#include "evpose/io/events/evt2.h"
#include "evpose/io/events/evt3.h"
#include "evpose/io/files/byte_stream.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

/// Bytes decoded in one go.
constexpr std::size_t kPiece = 64 << 10;
constexpr int kMostHeaderLines = 1000;
/// No word holds a pixel outside of this.
constexpr ImageSize kLargest = {65536, 32768};
/// Words looked at to find the order of their halves.
constexpr std::size_t kProbeBytes = 8000;

enum class Encoding { evt2, evt21, evt3 };

struct Header {
  Encoding encoding = Encoding::evt3;
  bool legacy = true;  ///< of EVT2.1
  ImageSize size;
};

using Keys = std::map<std::string, std::string>;

/// "% key value", keys in lower case; the parts "name=value" of `format` are keys of their own.
void take_key(const std::string& line, Keys& keys) {
  const std::string_view body = trimmed(std::string_view(line).substr(1));
  const auto blank = std::min(body.find(' '), body.size());
  const std::string key = lower_case(body.substr(0, blank));
  std::string_view value = trimmed(body.substr(blank));
  if (key != "format") {
    keys[key] = value;
    return;
  }
  for (bool first = true; !value.empty(); first = false) {
    const auto end = std::min(value.find(';'), value.size());
    const std::string_view part = value.substr(0, end);
    const auto equals = part.find('=');
    if (first) {
      keys["format"] = part;
    } else if (equals != std::string_view::npos) {
      keys[lower_case(part.substr(0, equals))] = part.substr(equals + 1);
    }
    value.remove_prefix(std::min(end + 1, value.size()));
  }
}

bool parse_side(const std::string& s, int& out) {
  std::int64_t value = 0;
  if (!parse_integer(trimmed(s), value) || value < 1 || value > 32768) return false;
  out = static_cast<int>(value);
  return true;
}

ImageSize size_of_sensor(const Keys& keys) {
  const auto value = [&](const char* key) {
    const auto it = keys.find(key);
    return it == keys.end() ? std::string() : lower_case(it->second);
  };
  const std::string generation = value("sensor_generation");
  const std::string name = value("sensor_name") + " " + value("plugin_name") + " gen" + generation;
  const auto is = [&](const char* part) { return name.find(part) != std::string::npos; };
  if (is("genx320")) return {320, 320};
  if (is("imx636") || is("imx646") || is("gen4")) return {1280, 720};
  if (is("gen3")) return {640, 480};
  return {};
}

ImageSize size_of(const Keys& keys) {
  ImageSize size;
  const auto find = [&](const char* key) {
    const auto it = keys.find(key);
    return it == keys.end() ? std::string() : it->second;
  };
  if (parse_side(find("width"), size.width) && parse_side(find("height"), size.height)) return size;
  const std::string geometry = find("geometry");
  const auto cross = geometry.find('x');
  if (cross != std::string::npos && parse_side(geometry.substr(0, cross), size.width) &&
      parse_side(geometry.substr(cross + 1), size.height))
    return size;
  return size_of_sensor(keys);
}

Expected<Encoding> encoding_of(const std::string& path, const Keys& keys) {
  std::string name;
  if (const auto it = keys.find("evt"); it != keys.end()) name = "EVT" + it->second;
  if (const auto it = keys.find("format"); it != keys.end()) name = it->second;
  if (name == "EVT2" || name == "EVT2.0") return Encoding::evt2;
  if (name == "EVT21" || name == "EVT2.1") return Encoding::evt21;
  if (name == "EVT3" || name == "EVT3.0") return Encoding::evt3;
  if (name.empty())
    return Error{path, "the header names no encoding (% evt or % format)", "is it a RAW file?"};
  return Error{path, "the encoding '" + name + "' cannot be read", "convert it to EVT2, EVT2.1 or EVT3"};
}

/// Leaves the stream at the first word.
Expected<Header> read_header(ByteStream& bytes) {
  Keys keys;
  std::string line;
  int lines = 0;
  for (; lines < kMostHeaderLines && bytes.take_line("% ", line); ++lines) {
    if (trimmed(line) == "% end") break;
    take_key(line, keys);
  }
  if (lines == 0 || lines == kMostHeaderLines)
    return Error{bytes.path(), "does not begin with the header of a RAW file", "is it a Prophesee RAW file?"};
  const auto encoding = encoding_of(bytes.path(), keys);
  if (!encoding) return encoding.error();
  Header header{
      .encoding = *encoding, .legacy = lower_case(keys["endianness"]) != "little", .size = size_of(keys)};
  if (header.encoding != Encoding::evt21) return header;
  const auto probe = bytes.peek(kProbeBytes);
  const auto head = probe.first(std::min(probe.size(), kProbeBytes));
  if (Evt21Decoder::time_words(head, header.legacy) == 0 &&
      Evt21Decoder::time_words(head, !header.legacy) > 0) {
    log_warning(bytes.path() + ": the words are in the other order than the header says; read as " +
                (header.legacy ? "little" : "legacy"));
    header.legacy = !header.legacy;
  }
  return header;
}

class RawSource : public EventSource {
 public:
  static Expected<std::unique_ptr<RawSource>> open(const std::string& path) {
    auto bytes = ByteStream::open(path);
    if (!bytes) return bytes.error();
    const auto header = read_header(*bytes);
    if (!header) return header.error();
    return std::unique_ptr<RawSource>(new RawSource(*std::move(bytes), *header));
  }

  Expected<bool> fetch(EventBlock& block) override { return fetch(block, nullptr); }
  Expected<bool> fetch(EventBlock& block, std::vector<Trigger>* triggers) {
    block.start();
    const auto bytes = bytes_.peek(kPiece);
    if (bytes.empty()) return false;
    const std::size_t used =
        std::visit([&](auto& decoder) { return decoder.decode(bytes, block, triggers); }, decoder_);
    block.sound_within = header_.size == ImageSize{} ? kLargest : header_.size;
    bytes_.skip(used);
    return used > 0;
  }

  void finish() const override {
    std::visit([&](const auto& decoder) { report(bytes_.path(), decoder.faults()); }, decoder_);
    if (bytes_.left() > 0)
      log_warning(
          text(bytes_.path(), ": ends within a word; the last ", bytes_.left(), " bytes are left out"));
  }

  const Header& header() const { return header_; }

 private:
  RawSource(ByteStream bytes, const Header& header) : bytes_(std::move(bytes)), header_(header) {
    if (header.encoding == Encoding::evt2) decoder_ = Evt2Decoder(header.size);
    if (header.encoding == Encoding::evt21) decoder_ = Evt21Decoder(header.size, header.legacy);
    if (header.encoding == Encoding::evt3) decoder_ = Evt3Decoder(header.size);
  }

  ByteStream bytes_;
  Header header_;
  std::variant<Evt2Decoder, Evt21Decoder, Evt3Decoder> decoder_;
};

const char* name_of(Encoding encoding) {
  return encoding == Encoding::evt2 ? "EVT2" : encoding == Encoding::evt21 ? "EVT2.1" : "EVT3";
}

}  // namespace

bool starts_as_raw(std::string_view head) {
  if (!head.starts_with("% ")) return false;
  for (std::size_t at = 0; head.substr(at).starts_with("% ");) {
    const auto end = head.find('\n', at);
    const std::string_view line = head.substr(at, end - at);
    if (line.starts_with("% evt ") || line.starts_with("% format ") || trimmed(line) == "% end") return true;
    if (end == std::string_view::npos) return false;
    at = end + 1;
  }
  return false;
}

Expected<std::unique_ptr<EventReader>> open_events_raw(const std::string& path,
                                                       const EventReadOptions& options) {
  const auto probe = RawSource::open(path);
  if (!probe) return probe.error();
  return make_event_reader(path, options, (*probe)->header().size,
                           [path]() -> Expected<std::unique_ptr<EventSource>> {
                             auto source = RawSource::open(path);
                             if (!source) return source.error();
                             return std::unique_ptr<EventSource>(*std::move(source));
                           });
}

Expected<std::vector<StreamInfo>> list_raw_streams(const std::string& path) {
  const auto source = RawSource::open(path);
  if (!source) return source.error();
  const std::string type = name_of((*source)->header().encoding);
  return std::vector<StreamInfo>{{StreamKind::events, "events", type, -1},
                                 {StreamKind::triggers, "triggers", type, -1}};
}

Status read_raw_sensors(const std::string& path, const SensorSink& sink) {
  if (!sink.trigger) return {};
  auto source = RawSource::open(path);
  if (!source) return source.error();
  EventBlock block;
  std::vector<Trigger> triggers;
  while (true) {
    const auto more = (*source)->fetch(block, &triggers);
    if (!more) return more.error();
    if (!*more) return {};
    for (const Trigger& trigger : triggers) sink.trigger(trigger);
    triggers.clear();
  }
}

}  // namespace evpose
