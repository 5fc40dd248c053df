"""Small valid files with much of what their formats can say; all are read without an error."""

ABAQUS = [
    """*HEADING
a frame
** comment
*NODE, NSET=ALL
1, 0., 0., 0.
2, 0., 0., 1.
3, 1., 0., 1.
4, 1., 0., 0.
*ELEMENT, TYPE=B31, ELSET=COLUMNS
1, 1, 2
2, 3, 4
*ELEMENT, TYPE=B32, ELSET=BEAM
3, 2, 5, 3
*NODE
5, .5, 0., 1.
*NSET, NSET=BASE
1, 4
*ELSET, ELSET=EVERYTHING
COLUMNS, BEAM
*ELSET, ELSET=SOME, GENERATE
1, 3, 2
*MATERIAL, NAME=STEEL
*ELASTIC
210000., .3
*BEAM SECTION, SECTION=RECT, ELSET=EVERYTHING, MATERIAL=STEEL
10., 20.
0., 1., 0.
""",
    """*PART, NAME=LEG
*NODE
1, 0., 0., 0.
2, 0., 0., 1.
*ELEMENT, TYPE=B31
1, 1, 2
*ELSET, ELSET=LEGS
1,
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=LEG-1, PART=LEG
*END INSTANCE
*INSTANCE, NAME=LEG-2, PART=LEG
1., 0., 0.
1., 0., 0., 1., 0., 1., 90.
*END INSTANCE
*NSET, NSET=FEET, INSTANCE=LEG-1
1,
*ELSET, ELSET=BOTH
LEG-1.1, LEG-2.1
*END ASSEMBLY
""",
    """*NODE
1, 0., 0.
11, 10., 0.
*NGEN, NSET=LINE
1, 11, 1
*ELEMENT, TYPE=B21
1, 1, 2
*ELGEN, ELSET=ROW
1, 10, 1, 1
""",
    """*SYSTEM
1., 0., 0., 1., 1., 0.
0., 1., 0.
*NODE, SYSTEM=C
1, 2., 0., 0.
2, 2., 45., 0.
3, 2., 90., 0.
*ELEMENT, TYPE=T3D2
1, 1, 2
2, 2, 3
""",
]

ABAQUS_MODELS = [
    """*NODE, NSET=ALL
1, 0., 0., 0.
2, 0., 1., 0.
3, 1., 1., 0.
4, 1., 0., 0.
5, 1., 0., 1.
6, 1., 1., 1.
*ELEMENT, TYPE=B31, ELSET=E
1, 1, 2
2, 2, 3
3, 3, 4
*ELEMENT, TYPE=B33, ELSET=F
4, 5, 6
*BEAM GENERAL SECTION, ELSET=E, SECTION=RECT
0.02, 0.03

2.1e11, 8e10
*BEAM SECTION, ELSET=F, MATERIAL=S, SECTION=PIPE
0.02, 0.003

3, 3
*MATERIAL, NAME=S
*ELASTIC
2.1e11,
*NSET, NSET=S
3, 4
*NSET, NSET=A, UNSORTED
S
*NSET, NSET=B
6
5
*MPC
TIE, A, B
*EQUATION
2
A, 3, 1., B, 3, -1.
*BOUNDARY
1, ENCASTRE
*ELEMENT, TYPE=MASS, ELSET=M
9, 3
*MASS, ELSET=M
2.
*STEP
*FREQUENCY
5
*END STEP
""",
]

NASTRAN_MODELS = [
    """SOL 103
INCLUDE 'alter.v9'
CEND
SPC = 1
BEGIN BULK
$HMNAME COMP                   1"legs" 7 "tube" 4
$ legL
GRID,1,,0.,0.,0.
GRID,2,,0.,0.,1.
CBAR,1,7,1,2,0.,1.,0.,,,6
$ beam
GRID,3,,1.,0.,1.
GRID,4,,1.,0.,0.
CBAR,2,7,2,3,0.,1.,0.
CBEAM,3,8,3,4,0.,1.,0.
CROD,4,9,1,3
$ Femap Property 7 : tube
PBARL,7,1,,TUBE,,,,,.05,.04
$ rails
PBEAM,8,1,1.-4,1.-8,1.-8,,2.-8
PROD,9,1,1.-4
$ Material Record : steel
MAT1,1,2.1+11,,.3
CONM2,90,3,,40.,,,,,.7
SPC1,1,123456,1,4
SPC1,2,12,1,2,3,4,1,2,3,4,1,2
SPOINT,1001,THRU,1009
QSET1,0,1001,THRU,1009
RBE2,50,3,123,2
MPC,1,2,1,1.,4,1,-1.
CELAS2,70,1.+5,3,1,4,1
ENDDATA
""",
]

NASTRAN = [
    """SOL 103
CEND
TITLE = frame
BEGIN BULK
$ comment
GRID,1,,0.,0.,0.
GRID,2,,0.,0.,1.
GRID    3               1.0     0.0     1.0
GRID*   4                               1.0             0.0
*       0.0
CBAR,1,7,1,2,0.,1.,0.
CBAR    2       7       3       4       0.0     1.0     0.0
CBEAM,3,8,2,3,0.,1.,0.
+,
CROD,4,9,1,3
PBAR,7,1,1.-4,1.-8,1.-8,2.-8
PBEAM,8,1,1.-4,1.-8,1.-8,,2.-8
MAT1,1,2.1+11,,.3,7850.
SPC1,1,123456,1,4
ENDDATA
""",
    """BEGIN BULK
CORD2R,5,,1.,0.,0.,1.,0.,1.
,2.,0.,0.
CORD2C,6,5,0.,0.,0.,0.,0.,1.
,1.,0.,0.
GRDSET,,6
GRID,1,,2.,0.,0.
GRID,2,,2.,45.,0.
GRID,3,0,2.,90.,0.
CONROD,1,1,2,1,1.-4
CTUBE,2,7,2,3
RBE2,9,1,123,2
ENDDATA
""",
]

GMSH_FRAME = """$MeshFormat
2.2 0 8
$EndMeshFormat
{names}$Nodes
4
1 0 0 0
2 0 0 1
3 1 0 1
4 1 0 0
$EndNodes
$Elements
5
1 15 2 7 1 1
2 15 2 7 4 4
3 1 2 {one} 1 1 2
4 1 2 {one} 2 2 3
5 1 2 {one} 3 3 4
$EndElements
"""
GMSH_NAMES = '$PhysicalNames\n2\n0 7 "feet"\n1 1 "frame"\n$EndPhysicalNames\n'

GMSH = [
    GMSH_FRAME.format(names=GMSH_NAMES, one=1),
    """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
1 1 "columns"
$EndPhysicalNames
$Entities
2 1 0 0
1 0 0 0 0
2 0 0 1 0
1 0 0 0 0 0 1 1 1 2 1 -2
$EndEntities
$Nodes
2 3 1 3
0 1 0 1
1
0 0 0
1 1 0 2
2
3
0 0 0.5
0 0 1
$EndNodes
$Elements
1 2 1 2
1 1 1 2
1 1 2
2 2 3
$EndElements
""",
]

VTK = [
    """# vtk DataFile Version 3.0
frame
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 3 double
0 0 0
0 0 1
1 0 1
CELLS 2 6
2 0 1
2 1 2
CELL_TYPES 2
3
3
CELL_DATA 2
SCALARS member int 1
LOOKUP_TABLE default
1
2
""",
]

CSV = [
    "# kind: accelerance, (m/s²)/N\nfrequency_Hz,re(1Z+/1Z+),im(1Z+/1Z+),re(2Z+/1Z+),im(2Z+/1Z+)\n"
    "1.0,0.1,0.2,0.3,-0.4\n2.0,0.1,0.2,0.3,-0.4\n3.0,1e-3,2e-2,0.3,-0.4\n",
    "# kind: mobility\nf;a\n1,5;1,0-2,5j\n2,5;1,0+2,5j\n",
    "% kind: receptance\n1 1e-6 -2e-7\n2 1e-6 -3e-7\n",
    'f [Hz];"H(3Z,1Z) Re [g/N]";"H(3Z,1Z) Im [g/N]"\n1;2;3\n2;3;4\n3;4;5\n',
]

MATRIX_MARKET = [
    "%%MatrixMarket matrix coordinate real symmetric\n% comment\n12 12 13\n"
    + "".join(f"{k} {k} {1e6 * k}\n" for k in range(1, 13))
    + "7 1 -5.0e5\n",
    "%%MatrixMarket matrix array real symmetric\n12 12\n"
    + "".join(f"{1e5 if k == j else 0.0}\n" for j in range(12) for k in range(j, 12)),
    "%%MatrixMarket matrix coordinate integer general\n12 12 12\n"
    + "".join(f"{k} {k} 7\n" for k in range(1, 13)),
]

CALCULIX = {
    "dof": "".join(f"{node}.{d}\n" for node in (1, 2) for d in (1, 2, 3)),
    "sti": "".join(f"{k} {k} {1e5 * k:.6E}\n" for k in range(1, 7)) + "4 1 -.5000000000000E+05\n",
    "mas": "".join(f"{k} {k} .1000000000000E+00\n" for k in range(1, 7)),
}

STUDY = [
    """[study]
name = "mast"
[points]
foot = [0.0, 0.0, 0.0]
tip = [0.0, 0.0, 1.2]
[members.mast]
from = "foot"
to = "tip"
section = { shape = "circle", d = 0.02 }
material = "steel"
[materials.steel]
E = 210e9
rho = 7850.0
[damping]
modal = 0.01
[[supports]]
point = "foot"
[[masses]]
point = "tip"
mass = 0.2
[[sensors]]
name = "t"
point = "tip"
direction = "x"
[[excitations]]
sensor = "t"
[frequency]
stop = 100.0
step = 1.0
[uncertain]
E = 0.02
rho = 0.01
damping = 0.3
""",
    """[points]
a = [0.0, 0.0, 0.0]
b = [0.0, 0.0, 0.5]
c = [0.5, 0.0, 0.5]
d = [0.1, 0.0, 0.1]
[members]
leg = { from = "a", to = "b" }
arm = { from = "b", to = "c", orientation = "z" }
brace = { from = "d", to = "c" }
[materials.alu]
E = 70e9
rho = 2700.0
nu = 0.33
[defaults]
material = "alu"
section = { shape = "rectangle", b = 0.03, h = 0.01 }
[damping]
loss_factor = 0.01
[[supports]]
point = "a"
fixed = "all"
[[joints]]
name = "J"
member1 = "leg"
position1 = 0.2
member2 = "brace"
position2 = 0.2
k = { krx = 2980.0, krz = 5000.0 }
rigid = "x y z ry"
eta = 0.006
[mesh]
element_size = 0.1
[fit]
band = [5.0, 90.0]
""",
]

COLUMNS = [
    "Freq [Hz];s1/s5 Real [g/N];s1/s5 Imag [g/N]\n1;2;3\n2;3;4\n3;4;5\n",
    "Project\tx\n\tH1,2\t\tH1,3\t\nFrequency\tReal\tImag\tReal\tImag\nUnits:\nHz\tg/N\t\tg/N\t\n1\t2\t3\t4\t5\n2\t3\t4\t5\t6\n",
    "f,Mag a/b [dB],Phase a/b [deg],Coh a/b\n1,2,3,1\n2,3,4,.9\n",
    "1 2+3j 4-5j\n2 3+4j 1j\n",
    "X axis unit\tHz\t\t\tHz\t\nResolution\t1 Hz\t\t\t\t\nDOF id\tPoint:3:-Z\t\t\twing:A:+X\t\n"
    "Reference DOF id\tPoint:2:+Z\t\t\tPoint:2:+Z\t\n"
    "Y axis unit\tg/N\t\t\tg/N\t\nFunction class\tFRF\t\t\tFRF\t\n"
    "Value type\tComplex\t\t\tComplex\t\n" + "".join(f"{k}\t{1 - k}.5\t2\t\t-1\t{k}\n" for k in range(12)),
    "X axis unit;Hz;\nDOF id;1:+Z;\nReference DOF id;1:+Z;\n"
    "Function class;FRF;Coherence\nValue type;Amplitude;\n"
    "Number of averages;3;3\n" + "".join(f"{k};{1 + k},5;0,9\n" for k in range(12)),
]

MAST = """sensors = "sensors.csv"
sections = "sections.csv"
[points]
foot = [0.0, 0.0, 0.0]
tip = [0.0, 0.0, 1.2]
[members]
mast = { from = "foot", to = "tip", section = "S1" }
[materials.steel]
E = 210e9
rho = 7850.0
[damping]
modal = 0.01
[[supports]]
point = "foot"
[[excitations]]
sensor = "t"
[[loads]]
case = "wind"
point = "tip"
force = [1.0, 0.0, 0.0]
[frequency]
stop = 100.0
step = 1.0
"""
"""A study that names tables beside it; it may end with one more."""

SENSORS = [
    "name,point,direction,label,gain\nt,tip,x,1Z+,1.0\nu,tip,y,2X-,2.5\n",
    "Name;x [mm];y [mm];z [mm];dx;dy;dz;kind;mass\nt;0;0;1200;1,0;0;0;accelerance;0,01\nu;0;0;600;0;1;0;;\n",
    "name,member,position,direction,sign,phase,conjugate\nt,mast,0.6,x,1,0,no\nv,mast,0.6,xyz,,,\nu,mast,1.2,-x,-1,90,yes\n",
]

SECTIONS = [
    "name,shape,d [mm],b,h,t\nS1,circle,20,,,\nS2,rectangle,,0.03,0.01,\n",
    "name;A [cm^2];Iy [cm4];Iz [cm4];J [cm4]\nS1;10,3;171;15,9;1,2\nS2;1;1;1;1\n",
    "Type,EDI_Std_Nomenclature,AISC_Manual_Label,A,d,bf,tw,tf,Ix,Iy,J,AISC_Manual_Label_SI\n"
    "W,S1,S1,10,8,8,.3,.4,110,37,.5,S1\n",
]

MODES = [
    "frequency [Hz],zeta [%],frequency_std,t,u\n9.3,1.0,0.001,0.3,1\n"
    "58.1,1.2,0.002,0.3-0.1j,-1\n9.4,,0.01,1,1\n",
    "f;t;u\n9,3;1;0,5\n58,1;-1;0,2\n",
]

TIMES = [
    "time [s],force [N],acc [g]\n" + "".join(f"{k / 512:.6f},{k % 3},{k % 5}.5\n" for k in range(12)),
    "t;a;b\n" + "".join(f"0,{k:02d};{k % 3},1;{k % 5}\n" for k in range(12)),
    "2026-01-01T00:00:00.{:03d},1\n".join(["stamp,a\n", *[""] * 5]).format(0, 1, 2, 3, 4),
    "Time ms\tacc_g\tTime ms\tN\nms\tg\tms\tN\n" + "".join(f"{k}\t1\t{k + 2}\t2\n" for k in range(9)),
]

EXCITATIONS = [
    "time [s],t [N],base x [g],wind\n0.0,0,1,0\n0.01,1,0.5,1\n0.02,0.5,0.1,0\n",
    "frequency [Hz],t [N^2/Hz],base x [g^2/Hz]\n1,1e-3,2\n10,1e-3,3\n100,1e-4,1\n",
    "period;x [g];rz\n0;0,3;0\n0,1;0,9;1\n1;0,2;1\n",
    "omega [rad/s]\tx\n1\t2\n2\t3\n",
]

POINTS = [
    "y [mm];x [mm];Point;z [mm]\n1,5;0;A;0\n2;0;B;1e3\n",
    "name,x,y,z\n1,0,0,0\nA2,0.0,0.5,1\n",
    '"a b",1,2,3\n',
]

DOFS = [
    "row,label,node,direction,x_m,y_m,z_m\n"
    + "".join(
        f"{6 * n - 5 + k},{n}{d},{n},{d},0,0,{n}\n"
        for n in (1, 2)
        for k, d in enumerate(("X", "Y", "Z", "RX", "RY", "RZ"))
    )
]

RECORDS = [
    '{"settings": {"a": 1, "b": [2, 3.5]}}\n{"refit": 0, "values": [1.0, 2.0]}\n{"refit": 1, "values": []}\n',
    '{"settings": {"a": 1, "b": [2, 3.5]}}\n{"refit": 0}\n{"refit": 1, "val',
]
