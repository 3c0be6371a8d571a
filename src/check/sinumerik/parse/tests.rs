use super::*;

fn read(text: &str) -> Result<Code, Fault> {
    let (post, _) = Postprocessor::load_built_in_or_file("sinumerik").unwrap();
    let code = parse(text, &post)?;
    // what is not known is refused by whoever asked for the code
    match code.unknown.first() {
        Some(first) => Err(Fault { at: first.at.clone(), says: first.name.clone() }),
        None => Ok(code),
    }
}

#[test]
fn what_is_not_known_is_an_error_with_its_place() {
    let mut wrong = Vec::new();
    for (text, place) in [
        ("G0 X1..5\nM30\n", 6),
        ("G0 X1 X=2\nM30\n", 6),
        ("G0X1\nM30\n", 2),
        ("G0 X1Y2\nM30\n", 5),
        ("FOOBAR\nM30\n", 0),
        ("G0 Q1\nM30\n", 3),
        ("G0 X=FOO\nM30\n", 5),
        ("CYCLE800()\nM30\n", 0),
        ("/G0 X1\nM30\n", 0),
        ("G0 X1\nDEF INT AB\nM30\n", 9),
        ("DEF INT X\nM30\n", 7),
        ("DEF INT AB\nDEF REAL AB\nM30\n", 19),
        ("DEF BOOL AB\nM30\n", 4),
        ("DEF REAL AB\nIF AB\nENDIF\nM30\n", 15),
        ("DEF REAL AB\nIF AB<1 OR AB>2\nENDIF\nM30\n", 19),
        ("DEF REAL AB\nIF AB<1\nM30\n", 12),
        ("ENDIF\nM30\n", 0),
        ("GOTOF NOWHERE\nM30\n", 0),
        ("AB:\nGOTOF AB\nM30\n", 4),
        ("GOTOB AB\nAB:\nM30\n", 0),
        ("AB:\nAB:\nM30\n", 4),
        ("GOTOF AB\nLOOP\nAB:\nENDLOOP\nM30\n", 0),
        ("DEF STRING[20] AB\nAB=SPRINT(\"%F\",1)\nM30\n", 29),
        ("DEF STRING[20] AB\nAB=SPRINT(\"%D\",1.5)\nM30\n", 32),
        ("DEF STRING[20] AB\nDEF REAL CD\nAB=\"A\"<<CD\nM30\n", 38),
        ("WRITE(AB,\"LOG\",\"A\")\nM30\n", 6),
        ("MSG(\"A)\nM30\n", 7),
        ("G0 X=$AA_FOO[X]\nM30\n", 5),
        ("G0 X=$AA_IM[W]\nM30\n", 5),
        ("SETAL(1,\"A\")\nM30\n", 5),
        ("G0 X1\n%_N_A_MPF\nM30\n", 6),
        ("G0 X1\n", 6),
        ("N70:\nM30\n", 0),
        ("GOTOF N70\nN70: G0 X1\nM30\n", 10),
        ("M30:\nM30\n", 0),
        ("G0:\nM30\n", 0),
        ("F100:\nM30\n", 0),
        ("RET:\nM30\n", 0),
        ("L10:\nM30\n", 0),
        ("R10:\nM30\n", 0),
        ("D0:\nM30\n", 0),
        ("DEF INT N1\nM30\n", 7),
        ("DEF INT FOR\nM30\n", 7),
        ("N100000000 G0 X1\nM30\n", 0),
        ("DEF INT AB\nAB:\nM30\n", 11),
        ("SOFT:\nM30\n", 0),
        ("TRANSMIT:\nM30\n", 0),
    ] {
        match read(text) {
            Ok(_) => wrong.push(format!("{text:?} was read")),
            Err(fault) if fault.at.start != place => {
                wrong.push(format!("{text:?}, not {place} but {}: {}", fault.at.start, fault.says));
            }
            Err(_) => {}
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn all_that_the_language_has_is_read() {
    let text = "%_N_A_MPF\n;$PATH=/_N_WKS_DIR\nDEF INT AB=1, CD ; two\nDEF REAL EF=1.5EX-3\nDEF STRING[80] GH=\"A;B\"\n\
        N10 G0 SUPA X-3.5 Y=AC(-2) Z=IC(.5)\nN20 G1 X=EF*2-(AB+1)/2 F=300 MEAS=1\nC=DC(90) G0\n\
        IF (AB==1) AND NOT (CD<>2)\nR1=ABS(-EF)\nELSE\nR1=ROUND(SQRT(4))\nENDIF\nWHILE CD<3\nCD=CD+1\nENDWHILE\n\
        LOOP\nIF CD>5 GOTOF OUT\nCD=CD+1\nENDLOOP\nOUT: STOPRE\nREPEAT\nCD=CD-1\nUNTIL CD==0\nSETAL(65000,\"A\"<<EF)\n\
        MSG()\nMSG(\"A \"<<AB<<GH)\nGH=SPRINT(\"N%D X%12.4F\",AB,EF)\nWRITE(CD,\"LOG\",GH<<AB)\nDELETE(CD,\"LOG\")\n\
        $AC_TIMER[1]=0\nSPOS=90\nM30\n";
    read(text).unwrap_or_else(|e| panic!("{:?} {}", &text[e.at.clone()], e.says));
}

#[test]
fn operations_bind_as_in_the_list_of_the_control() {
    let value = |written: &str| {
        let code = read(&format!("DEF REAL AB={written}\nM30\n")).unwrap();
        match &code.statements[0].what {
            Instruction::Set(_, expr) => expr.value(&|v| Err(v.to_string()), &|_| false).unwrap(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(value("2+3*4"), 14.0);
    assert_eq!(value("(2+3)*4"), 20.0);
    assert_eq!(value("10-2-3"), 5.0);
    assert_eq!(value("-2*-3"), 6.0);
    assert_eq!(value("12/3/2"), 2.0);
    assert_eq!(value("360*ROUND((10-350)/360)"), -360.0);
}

proptest::proptest! {
    #[test]
    fn rubbish_never_panics(text in "(DEF INT AB\n)?[ -~\n\u{e4}]{0,300}") {
        let _ = read(&text);
    }
}
