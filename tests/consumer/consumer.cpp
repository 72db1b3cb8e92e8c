// Makes a label image with the installed headers and writes a file with the installed library.
#include <treemarch/image/label_image.h>
#include <treemarch/mesh/output_file.h>

int main(int, char** argv) {
  const auto image = treemarch::make_label_image<2>({2, 1}, {5, 7});
  treemarch::OutputFile file(argv[1], true);
  file.write("labels");
  file.commit();
  return image.labels.size() == 2 ? 0 : 1;
}
