// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <hdf5.h>

#include <atomic>
#include <random>
#include <thread>

#include "evpose/io/files/test_files.h"
#include "evpose/io/hdf5/ecf.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/hdf5/test_ecf.h"
#include "evpose/io/hdf5/test_hdf5.h"

namespace evpose {
namespace {

std::span<const std::byte> bytes_of(const std::string& s) { return std::as_bytes(std::span(s)); }

TEST(Ecf, EveryPackingIsUndone) {
  for (const std::size_t count : {0u, 1u, 3u, 4u, 5u, 1000u, 65535u}) {
    const auto events = some_ecf_events(count);
    for (const EcfPacking packing : {EcfPacking::none, EcfPacking::columns, EcfPacking::all}) {
      std::vector<EcfEvent> out;
      ASSERT_TRUE(decode_ecf(bytes_of(encode_ecf(events, packing)), out)) << count;
      EXPECT_TRUE(same_events(out, events)) << count << " " << static_cast<int>(packing);
    }
  }
}

TEST(Ecf, CutOrSpoiltBlocksAreRefusedOrHaveTheirCount) {
  const auto events = some_ecf_events(200);
  std::mt19937 random(2);
  std::vector<EcfEvent> out;
  for (const EcfPacking packing : {EcfPacking::none, EcfPacking::columns, EcfPacking::all}) {
    const std::string block = encode_ecf(events, packing);
    for (std::size_t n = 0; n < block.size(); ++n)
      EXPECT_FALSE(decode_ecf(bytes_of(block.substr(0, n)), out)) << n;
    for (int i = 0; i < 2000; ++i) {
      std::string spoilt = block;
      spoilt[random() % spoilt.size()] = static_cast<char>(random());
      if (!decode_ecf(bytes_of(spoilt), out)) continue;
      EXPECT_LE(out.size(), 65535u);
    }
  }
}

TEST(Hdf5, AFileWhoseContentCannotBeListedIsRefused) {
  const TemporaryFolder folder;
  ForeignFile written(folder / "a.h5");
  written.put("/a/x", H5T_NATIVE_DOUBLE, std::vector<double>{1, 2});
  written.put("/b/x", H5T_NATIVE_DOUBLE, std::vector<double>{3});
  written.close();
  ASSERT_TRUE(Hdf5File::open(folder / "a.h5").value().dataset("/b/x").ok());
  // The node with the links of a group: what is in the others could still be asked for by name, untried.
  std::string bytes = content_of(folder / "a.h5");
  const auto at = bytes.rfind("SNOD");
  ASSERT_NE(at, std::string::npos);
  bytes[at] = 'X';
  const auto file = Hdf5File::open(folder.file("b.h5", bytes));
  ASSERT_FALSE(file.ok());
  EXPECT_TRUE(says(file.error().line(), {"b.h5", "damaged", "copy it again"}));
}

TEST(Hdf5, AFileIsTriedWhileAnotherThreadReads) {
  const TemporaryFolder folder;
  ForeignFile written(folder / "a.h5");
  written.put("/x", H5T_NATIVE_DOUBLE, std::vector<double>(1000, 1.0));
  written.close();
  const std::string bytes = content_of(folder / "a.h5");
  const Hdf5File read = Hdf5File::open(folder / "a.h5").value();
  std::atomic<bool> done = false;
  std::thread reader([&] {
    while (!done) read.has("/x");
  });
  // A child that is born while the library is locked waits forever: then this test never ends.
  for (int i = 0; i < 40; ++i) EXPECT_TRUE(Hdf5File::open(folder.file(text("b", i, ".h5"), bytes)).ok()) << i;
  done = true;
  reader.join();
}

TEST(Hdf5, AttributesBeyondTheirMessagesAreDamage) {
  const TemporaryFolder folder;
  for (const hsize_t before : {0, 512}) {  // bytes of somebody else
    const hid_t creation = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_userblock(creation, before);
    const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, creation, H5P_DEFAULT);
    // So many that the header is continued elsewhere.
    for (const char* name : {"first", "second", "third", "fourth"}) {
      const hsize_t shape[] = {2, 3};
      const hid_t space = H5Screate_simple(2, shape, nullptr);
      const hid_t attribute = H5Acreate2(file, name, H5T_STD_I32LE, space, H5P_DEFAULT, H5P_DEFAULT);
      const std::vector<std::int32_t> values{1, 2, 3, 4, 5, 6};
      ASSERT_GE(H5Awrite(attribute, H5T_NATIVE_INT32, values.data()), 0);
      H5Aclose(attribute), H5Sclose(space);
    }
    H5Pclose(creation), H5Fclose(file);
    const auto sound = Hdf5File::open(folder / "a.h5");
    ASSERT_TRUE(sound.ok()) << before;
    EXPECT_EQ(sound->attribute_numbers("/", "fourth"), (std::vector<double>{1, 2, 3, 4, 5, 6}));

    const std::string bytes = content_of(folder / "a.h5");
    for (const char* name : {"first", "fourth"}) {
      const auto at = bytes.find(name);  // after version, reserved, lengths of name, type and shape
      ASSERT_NE(at, std::string::npos);
      const auto refused = [&](std::size_t where, char value) {
        std::string changed = bytes;
        changed[where] = value;
        const auto opened = Hdf5File::open(folder.file("b.h5", changed));
        return !opened.ok() && says(opened.error().line(), {"b.h5", "damaged"});
      };
      EXPECT_TRUE(refused(at - 5, 0x70)) << "a name of 28,000 bytes: " << name;
      EXPECT_TRUE(refused(at - 3, 0x70)) << "a type: " << name;
      EXPECT_TRUE(refused(at - 1, 0x70)) << "a shape: " << name;
      constexpr std::size_t kName = 8, kType = 16;  // as stored
      EXPECT_TRUE(refused(at + kName + 4, 0x70)) << "elements of 112 bytes: " << name;
      EXPECT_TRUE(refused(at + kName + kType + 8, 0x70)) << "112 times 3 elements: " << name;
    }
  }
}

TEST(Hdf5, FiltersBeyondTheirMessagesAreDamage) {
  const TemporaryFolder folder;
  const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t rows = 100;
  H5Pset_chunk(properties, 1, &rows), H5Pset_shuffle(properties), H5Pset_deflate(properties, 4);
  const hid_t space = H5Screate_simple(1, &rows, nullptr);
  const hid_t set = H5Dcreate2(file, "x", H5T_STD_I16LE, space, H5P_DEFAULT, properties, H5P_DEFAULT);
  ASSERT_GE(set, 0);
  H5Dclose(set), H5Sclose(space), H5Pclose(properties), H5Fclose(file);
  ASSERT_TRUE(Hdf5File::open(folder / "a.h5").value().dataset("/x").ok());
  const std::string bytes = content_of(folder / "a.h5");
  for (const char* name : {"shuffle", "deflate"}) {
    const auto at = bytes.find(name);  // after number, length of the name, flags and number of values
    ASSERT_NE(at, std::string::npos);
    for (const std::size_t length : {at - 5, at - 1}) {
      std::string changed = bytes;
      changed[length] = 0x70;
      const auto opened = Hdf5File::open(folder.file("b.h5", changed));
      ASSERT_FALSE(opened.ok()) << name;
      EXPECT_TRUE(says(opened.error().line(), {"b.h5", "damaged"}));
    }
  }
}

TEST(Hdf5, AttributesWithBitsWhereNoNumberHasThemAreNone) {
  const TemporaryFolder folder;
  const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t space = H5Screate(H5S_SCALAR);
  struct Float {
    std::size_t bytes, exponent_bits, mantissa_bits;  // mantissa, exponent and sign from bit 0 on
    bool sound;
  };
  for (const auto& [bytes, exponent, mantissa, sound] : {Float{2, 5, 10, true},
                                                         {4, 8, 23, true},
                                                         {8, 11, 52, true},
                                                         {16, 15, 112, true},
                                                         {16, 70, 50, false},
                                                         {32, 15, 112, false}}) {
    const hid_t type = H5Tcopy(H5T_IEEE_F64LE);
    const std::size_t bits = mantissa + exponent + 1;
    ASSERT_GE(H5Tset_size(type, 32), 0);
    ASSERT_GE(H5Tset_precision(type, 256), 0);
    ASSERT_GE(H5Tset_fields(type, bits - 1, mantissa, exponent, 0, mantissa), 0);
    ASSERT_GE(H5Tset_precision(type, bits), 0);
    ASSERT_GE(H5Tset_size(type, bytes), 0);
    H5Tset_ebias(type, (std::size_t{1} << (std::min<std::size_t>(exponent, 60) - 1)) - 1);
    EXPECT_EQ(is_sound_number(type), sound) << bytes << " bytes";
    const std::string name = text("f", bytes, '_', exponent);
    const hid_t attribute = H5Acreate2(file, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(attribute, 0);
    const std::string zeros(bytes, '\0');
    ASSERT_GE(H5Awrite(attribute, type, zeros.data()), 0);
    H5Aclose(attribute), H5Tclose(type);
  }
  H5Sclose(space), H5Fclose(file);
  const auto opened = Hdf5File::open(folder / "a.h5");
  ASSERT_TRUE(opened.ok());
  for (const char* name : {"f2_5", "f4_8", "f8_11", "f16_15"})
    EXPECT_EQ(opened->attribute_numbers("/", name), std::vector<double>{0}) << name;
  for (const char* name : {"f16_70", "f32_15"}) EXPECT_FALSE(opened->attribute_numbers("/", name)) << name;
}

}  // namespace
}  // namespace evpose
