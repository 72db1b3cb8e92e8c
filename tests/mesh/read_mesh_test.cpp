#include "treemarch/mesh/read_mesh.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "support/meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/move_to_inner.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/mesh/write_mesh.h"

namespace treemarch {
namespace {

namespace fs = std::filesystem;
using testing::box_mesh;
using testing::mixed_mesh;

class ReadMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("read_mesh_test" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  template <int Dim>
  Mesh<Dim> through_file(const std::string& name, const Mesh<Dim>& mesh, const Frame<Dim>& frame,
                         bool compress = true) {
    const std::string path = folder_ / name;
    write_mesh(path, mesh, frame, {.overwrite = true, .compress = compress}, execution_);
    return std::get<Mesh<Dim>>(read_mesh(path, execution_));
  }
  AnyMesh read_text(const std::string& name, const std::string& text) {
    const std::string path = folder_ / name;
    std::ofstream(path, std::ios::binary) << text;
    return read_mesh(path, execution_);
  }
  static std::string content(const fs::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  fs::path folder_;
  Execution execution_{2};
};

/// Cells in a normal form: label and place of the vertices. Formats may sort cells by label.
template <int Dim>
std::vector<std::pair<std::int32_t, std::vector<Vec<Dim>>>> content_of(const Mesh<Dim>& mesh, const Frame<Dim>* frame) {
  std::vector<std::pair<std::int32_t, std::vector<Vec<Dim>>>> cells;
  for (const CellBlock& block : mesh.blocks)
    for (std::int64_t c = 0; c < block.size(); ++c) {
      std::vector<Vec<Dim>> p;
      for (int i = 0; i < vertex_count(block.type); ++i) {
        const Vec<Dim>& x = mesh.points[block.cell(c)[i]];
        p.push_back(frame ? to_world(*frame, x) : x);
      }
      cells.emplace_back(mesh.labels[block.materials[c]], std::move(p));
    }
  std::sort(cells.begin(), cells.end());
  return cells;
}

TEST_F(ReadMeshTest, GivesBackWhatWasWritten) {
  constexpr std::int32_t kHard[] = {0, -1, 70000, 2147483647, 5, -2147483647 - 1};
  const Mesh<3> box = box_mesh<3>({6, 3, 2}, [&](const Coord<3>& c) { return kHard[c[0]]; }, {0.1, 0.7, 1.0 / 3});
  const Mesh<2> flat = box_mesh<2>({6, 3}, [&](const Coord<2>& c) { return kHard[c[0]]; }, {0.1, 0.7});
  Frame<3> frame;
  frame.origin = {100.1, -3, 1e-3};
  frame.direction = {Vec<3>{0.6, 0.8, 0}, {-0.8, 0.6, 0}, {0, 0, 1}};
  const Frame<2> kPlain2;
  for (const char* name : {"a.vtu", "a.msh", "a.mesh"}) {
    EXPECT_EQ(content_of<3>(through_file(name, box, frame), nullptr), content_of(box, &frame)) << name;
    const Mesh<3> mixed = through_file<3>(name, mixed_mesh(), {});
    const Frame<3> plain;
    EXPECT_EQ(content_of<3>(mixed, nullptr), content_of(mixed_mesh(), &plain)) << name;
    EXPECT_EQ(content_of<2>(through_file(name, flat, kPlain2), nullptr), content_of(flat, &kPlain2)) << name;
  }
  EXPECT_EQ(content_of<3>(through_file("a.vtu", box, frame, false), nullptr), content_of(box, &frame));
  for (const bool compress : {false, true}) {
    EXPECT_EQ(content_of<3>(through_file("a.xdmf", box, frame, compress), nullptr), content_of(box, &frame));
    EXPECT_EQ(content_of<2>(through_file<2>("a.xdmf", flat, {}, compress), nullptr), content_of(flat, &kPlain2));
  }
  EXPECT_THROW(through_file<3>("b.xdmf", mixed_mesh(), {}), Error);
  EXPECT_FALSE(fs::exists(folder_ / "b.h5"));
}

TEST_F(ReadMeshTest, GivesBackSpaceTime) {
  Mesh<4> mesh =
      box_mesh<4>({3, 1, 2, 2}, [&](const Coord<4>& c) { return c[3] - 2 * c[0]; }, {0.1, 0.7, 1.5, 1.0 / 3});
  mesh.names.assign(mesh.labels.size(), "");
  mesh.names[1] = "left atrium";
  Frame<4> frame;
  frame.spacing = {0.1, 0.7, 1.5, 1.0 / 3};
  frame.origin = {100.1, -3, 1e-3, 2};
  frame.direction = {Vec<4>{0.6, 0.8, 0, 0}, {0.8, -0.6, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 0.15}};  // left-handed
  frame.space = "RAST";
  write_mesh(folder_ / "a.xdmf", mesh, frame, {}, execution_);
  MeshRecord record;
  const auto read = std::get<Mesh<4>>(read_mesh(folder_ / "a.xdmf", execution_, &record));
  EXPECT_TRUE(validate(read, execution_).sound());
  EXPECT_EQ(read.names, mesh.names);
  EXPECT_EQ(record.space, "RAST");
  ASSERT_EQ(record.affine.size(), 25U);
  EXPECT_DOUBLE_EQ(record.affine[18], 0.15 / 3);
  EXPECT_DOUBLE_EQ(record.affine[19], 2);
  Mesh<4> back = read;
  move_to_inner(back, frame, execution_);
  ASSERT_EQ(back.blocks[0].vertices, mesh.blocks[0].vertices);
  for (std::size_t i = 0; i < mesh.points.size(); ++i) EXPECT_LT(norm(back.points[i] - mesh.points[i]), 1e-12);
  EXPECT_THROW(write_mesh<4>(folder_ / "a.vtu", mesh, frame, {}, execution_), Error);
}

TEST_F(ReadMeshTest, LeftHandedCellsArePositiveInTheWorld) {
  Frame<3> frame;
  frame.direction[1] = {0, -1, 0};
  for (const char* name : {"a.vtu", "a.msh", "a.mesh"}) {
    const Mesh<3> mesh = through_file<3>(name, mixed_mesh(), frame);
    const MeshDefects defects = validate(mesh, execution_);
    EXPECT_TRUE(defects.fills_box()) << name << ": " << defects.describe();
    EXPECT_EQ(mesh.cell_count(), mixed_mesh().cell_count());
  }
}

TEST_F(ReadMeshTest, KeepsNames) {
  Mesh<3> mesh = box_mesh<3>({2, 1, 1}, [](const Coord<3>& c) { return c[0] + 1; });
  mesh.names = {"", "grey matter"};
  EXPECT_EQ(through_file<3>("a.vtu", mesh, {}).names, mesh.names);
}

TEST_F(ReadMeshTest, SameBytesForAnyNumberOfThreads) {
  const Mesh<3> mesh = box_mesh<3>({40, 40, 20}, [](const Coord<3>& c) { return c[1] % 3; });
  for (const char* name : {"a.vtu", "a.msh", "a.mesh"}) {
    write_mesh<3>(folder_ / name, mesh, {}, {.overwrite = true}, Execution(1));
    const std::string one = content(folder_ / name);
    write_mesh<3>(folder_ / name, mesh, {}, {.overwrite = true}, Execution(3));
    EXPECT_EQ(one, content(folder_ / name)) << name;
  }
  write_mesh<3>(folder_ / "a.xdmf", mesh, {}, {.overwrite = true}, Execution(1));
  const std::string arrays = content(folder_ / "a.h5");
  write_mesh<3>(folder_ / "a.xdmf", mesh, {}, {.overwrite = true}, Execution(3));
  EXPECT_EQ(arrays, content(folder_ / "a.h5"));
}

TEST_F(ReadMeshTest, ReadsOtherEncodingsOfVtu) {
  auto file = [](const std::string& root, const std::string& points) {
    return "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\" " + root +
           "><UnstructuredGrid><Piece NumberOfPoints=\"3\" NumberOfCells=\"1\"><Points>" + points +
           "</Points><Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2</DataArray>"
           "<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">3</DataArray>"
           "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">5</DataArray></Cells><CellData>"
           "<DataArray type=\"Int32\" Name=\"label\" format=\"ascii\">-7</DataArray></CellData></Piece>"
           "</UnstructuredGrid></VTKFile>";
  };
  const std::string text =
      "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 2 0</DataArray>";
  // The same nine floats in base64 after their length in bytes, 36, as one stream and as two.
  const std::string one =
      "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">\n"
      "JAAAAAAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAABAAAAAAA==\n</DataArray>";
  const std::string two =
      "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">\n"
      "JAAAAA==AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAAEAAAAAA\n</DataArray>";
  for (const std::string& points : {text, one, two}) {
    const auto mesh = std::get<Mesh<2>>(read_text("a.vtu", file("header_type=\"UInt32\"", points)));
    EXPECT_EQ(mesh.points, (Points<2>{{0, 0}, {1, 0}, {0, 2}}));
    EXPECT_EQ(mesh.labels, std::vector<std::int32_t>{-7});
  }
}

TEST_F(ReadMeshTest, ReadsTextOfGmsh) {
  const std::string text =
      "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n4 0 0 0 1 1 0 1 9 0\n$EndEntities\n"
      "$Nodes\n1 3 5 30\n2 4 0 3\n5\n30\n7\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n"
      "$Elements\n1 1 1 1\n2 4 2 1\n1 5 30 7\n$EndElements\n";
  const auto mesh = std::get<Mesh<2>>(read_text("a.msh", text));
  EXPECT_EQ(mesh.labels, std::vector<std::int32_t>{9});
  EXPECT_EQ(mesh.blocks[0].vertices, (RawVector<VertexId>{0, 1, 2}));
}

TEST_F(ReadMeshTest, RefusesWhatIsNoMesh) {
  for (const char* name : {"a.vtu", "a.msh", "a.mesh", "a.xdmf"}) {
    EXPECT_THROW(read_mesh(folder_ / "missing" / name, execution_), Error) << name;
    for (const char* text : {"", "\n", "nonsense", "<VTKFile", "MeshVersionFormatted 2 Dimension 3 End",
                             "MeshVersionFormatted 2 Dimension 3 Vertices 99999999999 1 2 3"})
      EXPECT_THROW(read_text(name, text), Error) << name << ": " << text;
  }
  EXPECT_THROW(read_text("a.stl", "solid"), Error);
  EXPECT_THROW(read_mesh(folder_.string() + "/", execution_), Error);
}

TEST_F(ReadMeshTest, RefusesXdmfWithoutItsArrays) {
  write_mesh<3>(folder_ / "a.xdmf", box_mesh<3>({1, 1, 1}, [](const Coord<3>&) { return 1; }), {}, {}, execution_);
  const std::string arrays = content(folder_ / "a.h5");
  for (const std::string& bytes : {arrays.substr(0, arrays.size() / 2), std::string(500, 'x'), std::string()}) {
    std::ofstream(folder_ / "a.h5", std::ios::binary) << bytes;
    EXPECT_THROW(read_mesh(folder_ / "a.xdmf", execution_), Error);
  }
  fs::remove(folder_ / "a.h5");
  EXPECT_THROW(read_mesh(folder_ / "a.xdmf", execution_), Error);
}

/// Whatever happens to a file, reading it ends with a mesh or with one line.
TEST_F(ReadMeshTest, SurvivesDamage) {
  std::mt19937 random(7);
  const Mesh<3> mesh = box_mesh<3>({2, 2, 2}, [](const Coord<3>& c) { return c[2] - 1; });
  int refused = 0;
  for (const char* name : {"a.vtu", "b.vtu", "a.msh", "a.mesh"}) {
    write_mesh<3>(folder_ / name, mesh, {}, {.overwrite = true, .compress = name[0] == 'a'}, execution_);
    const std::string whole = content(folder_ / name);
    for (int trial = 0; trial < 250; ++trial) {
      std::string damaged = whole;
      for (std::size_t n = 1 + random() % 3; n-- > 0;) {
        const std::size_t at = random() % damaged.size();
        switch (random() % 4) {
          case 0:
            damaged[at] = static_cast<char>(random());
            break;
          case 1:
            damaged.resize(at + 1);
            break;
          case 2:
            damaged.erase(at, random() % 40);
            break;
          default:
            damaged.insert(at, damaged.substr(random() % damaged.size(), random() % 40));
        }
      }
      try {
        validate(std::get<Mesh<3>>(read_text(name, damaged)), execution_);
      } catch (const Error& error) {
        ++refused;
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        EXPECT_EQ(error.kind(), ErrorKind::input) << error.what();
      }
    }
  }
  EXPECT_GT(refused, 300);
}

}  // namespace
}  // namespace treemarch
